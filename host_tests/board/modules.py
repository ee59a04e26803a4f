"""Modules of the core for boards under test: single ones on a board with little else, and overlays
of an image."""

from collections.abc import Iterable, Mapping

from framestep_tools.board import overlay
from framestep_tools.board.module_files import dotted
from framestep_tools.building import board_files, images
from framestep_tools.building.board_files import board_sources, compiled, folded


def board_modules(names: Iterable[str]) -> dict[str, bytes]:
    """Return {device path: content} of the core's modules with these names ("io/lights"), compiled
    for an RP2040.

    Their constants keep their names: the tests' own programs import them.
    """
    sources = folded({}, hide=False)
    return {
        f"/lib/framestep/{name}.mpy": compiled(
            f"framestep/{name}.py", sources[f"framestep/{name}.py"], "armv6m"
        )
        for name in names
    }


def edited(name, more="", old="", new=""):
    """Return a module with a text replaced, and lines added at its end."""
    source = board_sources("pico")[name].decode()
    assert not old or source.count(old) == 1
    text = (source.replace(old, new) + more).encode()
    return compiled(name.replace(".mpy", ".py"), text, "armv6m")


def ident_of(board: str) -> str:
    """Return the ID of a board's image, as in framestep_image."""
    return images.image_module(board_files.board_modules("armv6m", board)).split("'")[1]


def on_board(ident: str, modules: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return the files of a board with this overlay. ident: of its image."""
    listing = " ".join([ident, *map(dotted, modules)]).encode()
    files = {f"{overlay.FOLDER}/{name}": content for name, content in modules.items()}
    return {**files, overlay.LIST: listing}
