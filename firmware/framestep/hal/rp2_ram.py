"""Modules of a frozen image that run from RAM.

Frozen code lies in flash and is read through a cache of 16 kB, which the main loop keeps turning
over; code that an interrupt runs each millisecond then takes about twice as long. The image
therefore holds such modules as files, in framestep/ram_files.py, and they are imported from a file
system of these files before anybody else asks for them.
"""

import errno
import io
import sys

import vfs

_MOUNT = "/framestep-ram"
_FILE = (0x8000, 0, 0, 0, 0, 0, 0, 0, 0, 0)  # what os.stat() says of a file


class _Files:
    """A file system, read only: {path: bytes}."""

    def __init__(self, files):
        self.files = files

    def mount(self, readonly, mkfs):
        pass

    def umount(self):
        pass

    def stat(self, path):
        if path.lstrip("/") in self.files:
            return _FILE
        raise OSError(errno.ENOENT)

    def open(self, path, mode):
        return io.BytesIO(self.files[path.lstrip("/")])


def load(files):
    """Import the modules of these files, {"package/module.mpy": content}, into their packages.
    Allocates."""
    vfs.mount(_Files(files), _MOUNT)
    for path in files:
        package, name = path[: -len(".mpy")].replace("/", ".").rsplit(".", 1)
        __import__(package)
        frozen = sys.modules[package].__path__
        sys.modules[package].__path__ = _MOUNT + "/" + package.replace(".", "/")
        try:
            __import__(package + "." + name)
        finally:
            sys.modules[package].__path__ = frozen
    vfs.umount(_MOUNT)
