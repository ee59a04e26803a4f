"""Lets modules on the file system replace modules of the image; `framestep flash` puts them there.

/overlay holds the modules (framestep/motors/backlash.mpy). /overlay/modules is written last: it has
the ID of the image for which they were compiled (framestep_image.ID), then their names. If another
image finds the folder, or the list is missing, the overlay is left out. This module, boot.py,
main.py, framestep/__init__ and framestep/soft_reset cannot be replaced.

A frozen package looks for its modules in only one place, the string __path__. So every import goes
through `_import`, which points __path__ to the right place for that one import. Modules are loaded
in the same order as without an overlay, and only when something imports them.

A start that fails because of the overlay is not repeated: `modules` is renamed to `failed`, the
reason is appended, and the board restarts with the image's own modules. If the start hangs or the
processor faults, the watchdog resets the board, and a scratch register keeps the reason.
"""

import builtins
import gc
import os
import sys

from machine import mem32

_FOLDER = "/overlay"
_LIST = "/overlay/modules"
_FAILED = "/overlay/failed"
_SECONDS = 8  # the longest time that the RP2040's watchdog can wait

# RP2040 datasheet 4.7, RP2350 12.9
_RP2350 = "RP2350" in sys.implementation._machine
_WATCHDOG = 0x400D8000 if _RP2350 else 0x40058000
_LOAD, _SCRATCH0 = _WATCHDOG + 4, _WATCHDOG + 12
_COUNTS = 1 if _RP2350 else 2  # of its counter, per microsecond (erratum RP2040-E1)
_ENABLE = 1 << 30
_SET, _CLEAR = 0x2000, 0x3000  # aliases of a register that set and clear bits
_STARTING = 0x1DEA5C3B  # in SCRATCH0; framestep.hal.rp2.watchdog looks for it

_modules = sys.modules
_names = set()
_frozen_import = builtins.__import__
in_use = False  # whether modules of the overlay replace the image's


def _import(name, globals=None, locals=None, names=None, level=0):
    """Replacement of builtins.__import__. A single function, because imports nest six deep, and
    each call takes 250 bytes of the stack."""
    if name in _modules or not name.startswith("framestep."):
        return _frozen_import(name, globals, locals, names, level)
    package = name[: name.rfind(".")]
    if package not in _modules:
        _import(package)
    parent = _modules[package]
    path = parent.__path__
    if name in _names:
        parent.__path__ = _FOLDER + "/" + package.replace(".", "/")
    # a module of the overlay imports one of the image
    elif path.startswith(_FOLDER):  # type: ignore[attr-defined]
        parent.__path__ = ".frozen/" + package.replace(".", "/")
    try:
        return _frozen_import(name, globals, locals, names, level)
    finally:
        parent.__path__ = path


def _give_up(write):
    """Leave the overlay out from the next start on. write(file): appends the reason."""
    os.rename(_LIST, _FAILED)
    with open(_FAILED, "a") as file:
        write(file)


def _read():
    """Read the list. Return why the overlay is left out, or None."""
    hung = mem32[_SCRATCH0] == _STARTING
    mem32[_SCRATCH0] = 0
    present = os.listdir(_FOLDER)
    if "modules" not in present:
        return (
            "it failed before: see /overlay/failed" if "failed" in present else "it is incomplete"
        )
    if hung:
        _give_up(lambda file: file.write("the start hung\n"))
        return "the start hung"
    from framestep_image import ID

    del _modules["framestep_image"]

    with open(_LIST) as file:
        words = file.read().split()
    if not words or words[0] != ID:
        return "it is for another image"
    _names.update(words[1:])


def begin():
    """Put the overlay in place. Called first after a reset if its folder exists."""
    global in_use
    try:
        reason = _read()
    except Exception as error:
        reason = repr(error)
    if reason:
        print("framestep: the overlay is left out:", reason)
    else:
        in_use = True
        builtins.__import__ = _import
    gc.collect()  # leave no hole in the memory into which framestep is loaded


def start(again=False):
    """Start framestep. If that fails, restart the board without the overlay."""
    if in_use:
        mem32[_SCRATCH0] = _STARTING
        mem32[_LOAD] = _SECONDS * 1_000_000 * _COUNTS
        mem32[_WATCHDOG + _SET] = _ENABLE
    try:
        import framestep.boot

        framestep.boot.start(again)
    except Exception as error:
        if mem32[_SCRATCH0] != _STARTING:  # the start was over
            raise
        failure = error
        _give_up(lambda file: sys.print_exception(failure, file))  # type: ignore[attr-defined]
        sys.print_exception(error)  # type: ignore[attr-defined]
        print("framestep: restarting without the overlay")
        started()
        import machine

        machine.reset()
    finally:
        started()


def started():
    """Switch the watchdog off after the start, or if somebody interrupted it."""
    if mem32[_SCRATCH0] == _STARTING:
        mem32[_SCRATCH0] = 0
        mem32[_WATCHDOG + _CLEAR] = _ENABLE
