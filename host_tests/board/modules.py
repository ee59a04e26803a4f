"""Single modules of the core, for tests that need a board with little else on it."""

from collections.abc import Iterable

from framestep_tools.building.board_files import compiled, folded


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
