"""The program of a state machine that watches a pin, and the meaning of its stamps."""

import numpy as np

CYCLES = 2  # of the loop; also the resolution of a stamp
HIGH, LOW, LENGTH = (
    2,
    6,
    8,
)  # addresses at which a machine waits while its pin is high, low; length in instructions

_JMP_X, _JMP_PIN = 0x0040, 0x00C0  # RP2040 datasheet 3.4
_ISR_X, _PUSH, _NOP = 0xA0C1, 0x8000, 0xA042
_STAMP, _PASS_BY = (_ISR_X, _PUSH), (_NOP, _NOP)


def program(origin: int, both: bool) -> list[int]:
    """Return the instructions, loaded at `origin`, that stamp a pin's edges or only rising ones."""
    return [
        *_STAMP,
        _JMP_X | origin + HIGH + 1,
        _JMP_PIN | origin + HIGH,
        *(_STAMP if both else _PASS_BY),
        _JMP_X | origin + LOW + 1,
        _JMP_PIN | origin,
    ]


def times_ns(stamps: np.ndarray, both: bool, skip: int, clock_hz: int) -> np.ndarray:
    """Return the times of consecutive stamps, ns since the start. skip: stamps before the first.

    A turn of the loop takes two cycles and counts one. An edge takes two more cycles, which are not
    counted. So does a falling edge that is not stamped.
    """
    before = np.append(0xFFFFFFFF, stamps[:-1]).astype(np.int64)
    passes = np.cumsum((before - stamps) & 0xFFFFFFFF)
    edges = (np.arange(len(stamps)) + skip) * (1 if both else 2)
    return (passes + edges) * (CYCLES * 1e9 / clock_hz)
