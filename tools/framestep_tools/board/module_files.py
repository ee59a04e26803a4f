"""Modules as files on a board, with a list of them that is written last.

The list is removed before any file changes. So whatever interrupts the work, the board finds all of
the old modules, all of the new ones, or no list.
"""

from collections.abc import Callable, Iterable, Mapping
from hashlib import sha256
from typing import NamedTuple, Protocol

from .repl_device import DeviceError


class Files(Protocol):
    """A board's file system."""

    def files(self, folder: str) -> list[str]: ...
    def hashes(self, names: Iterable[str]) -> dict[str, bytes]: ...
    def read(self, name: str) -> bytes | None: ...
    def write(self, name: str, data: bytes) -> None: ...
    def replace(self, name: str, data: bytes) -> None: ...
    def remove(self, name: str) -> None: ...
    def run(self, script: str) -> str: ...


class Place(NamedTuple):
    """root: folder in which "framestep/motors/axis.mpy" lies; folder: everything in it belongs to
    the modules; list: path of the list."""

    root: str
    folder: str
    list: str


def dotted(name: str) -> str:
    """Convert a module's path to its name: framestep.motors.axis."""
    return name.removesuffix(".mpy").removesuffix("/__init__").replace("/", ".")


def listing(ident: str, modules: Iterable[str]) -> bytes:
    """Return the list's content. ident: what the modules are for."""
    return " ".join([ident, *sorted(map(dotted, modules))]).encode() + b"\n"


def put(
    board: Files,
    place: Place,
    ident: str,
    modules: Mapping[str, bytes],
    say: Callable[[str], None],
    others: Mapping[str, bytes] | None = None,
) -> int:
    """Make the place hold these modules only, {"framestep/motors/axis.mpy": content}. others:
    {path: content} of files elsewhere that belong to them. Return the number of files written and
    removed."""
    there = board.files(place.folder)
    wanted = {f"{place.root}/{name}": content for name, content in modules.items()}
    others = others or {}
    hashes = {path: sha256(content).digest() for path, content in {**wanted, **others}.items()}
    present = board.hashes([*(path for path in there if path in wanted), *others])
    changed = [path for path in sorted(hashes) if present.get(path) != hashes[path]]
    stale = [path for path in there if path not in wanted and path != place.list]
    found = listing(ident, modules)
    if not changed and not stale and place.list in there and board.read(place.list) == found:
        return 0
    if place.list in there:
        board.remove(place.list)
    for path in stale:
        board.remove(path)
    for i, path in enumerate(changed, 1):
        content = wanted[path] if path in wanted else others[path]
        say(f"copying {i}/{len(changed)} {path} ({len(content)} bytes)")
        (board.write if path in wanted else board.replace)(path, content)
    arrived = board.hashes(sorted(hashes))
    if damaged := [path for path in hashes if arrived.get(path) != hashes[path]]:
        raise DeviceError(
            f"{', '.join(damaged)} did not arrive as sent; try again, perhaps with another cable"
        )
    board.replace(place.list, found)
    return len(changed) + len(stale) + 1
