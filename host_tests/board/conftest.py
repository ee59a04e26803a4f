"""The chips of the boards. Tests that ask for `chip` run on each: on the Pico 2 one case of each,
with --all only."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pytest

from framestep_emulator import Emulator
from framestep_tools.building import images
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.selection import one_of_each, parameters


@dataclass(frozen=True, eq=False)
class Chip:
    """A board's image. Tests use the pins of a Pico, in its rig, too."""

    board: str  # a folder in boards/
    rig: Mapping[str, Any]  # settings that give it the pins of a Pico
    slow_mhz: int  # its slowest clock
    watchdog: int  # address of CTRL (RP2040 datasheet 4.7.6, RP2350 12.9.7)
    dma_channels: int
    dma_busy: int  # mask of BUSY in CTRL (RP2040 datasheet 2.5.7, RP2350 12.6.10)

    def settings(self, rig: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Return a rig file for this chip."""
        return {**self.rig, **(rig or {})}

    def emulated(self, rig: Mapping[str, Any] | None = None, **options: Any) -> EmulatedBoard:
        """Start a board with framestep."""
        return EmulatedBoard(self.settings(rig), board=self.board, **options)

    def emulator(self, **options: Any) -> Emulator:
        """Return an emulator with the image; it is to be started."""
        return Emulator(images.frozen(self.board), **options)

    def bare(self, files: Mapping[str, bytes]) -> Emulator:
        """Return an emulator on which framestep has not begun: with MicroPython alone, or, of a
        chip for which that is not built, with the image."""
        if self is PICO:
            return Emulator(images.emulator_ready(), files=files)
        return self.emulator(files={**files, "/main.py": b""})


PICO = Chip("pico", {}, 125, 0x40058000, 12, 1 << 24)
# with more motors than a Pico has, the pins of inputs, outputs and DMX are motors' pins
PICO2 = Chip("pico2", {"motor_count": 8}, 150, 0x400D8000, 16, 1 << 26)


def _on(*chips: Any) -> pytest.MarkDecorator:
    return pytest.mark.parametrize(
        "chip", chips, ids=lambda chip: chip.board, indirect=True, scope="module"
    )


# Tests that ask for `chip` have it from conftest.py, but for these:
on_pico = _on(PICO)  # what they are about is the same code on either chip
on_both = _on(PICO, PICO2)  # in each run
on_pico2 = _on(pytest.param(PICO2, marks=pytest.mark.repeats))  # what only that chip can do


@pytest.fixture(
    scope="module",
    params=[PICO, pytest.param(PICO2, marks=pytest.mark.repeats)],
    ids=lambda chip: chip.board,
)
def chip(request):
    return request.param


def pytest_collection_modifyitems(config, items):
    pico2 = {item for item in items if parameters(item).get("chip") is PICO2}
    left_out = pico2 - one_of_each(pico2)
    config.hook.pytest_deselected(items=[item for item in items if item in left_out])
    items[:] = [item for item in items if item not in left_out]
