"""Modules of the core by themselves, for tests that need a board with little else on it."""

from collections.abc import Iterable

from framestep_tools.building.board_files import compiled, folded


def board_modules(names: Iterable[str]) -> dict[str, bytes]:
    """{device path: content} of the core's modules named so ("io/lights"), compiled as they are for
    a board.

    Their constants keep their names: the tests' own programs import them.
    """
    sources = folded({}, hide=False)
    return {
        f"/lib/framestep/{name}.mpy": compiled(
            f"framestep/{name}.py", sources[f"framestep/{name}.py"], "armv6m"
        )
        for name in names
    }
