"""The program with which a state machine watches a pin, and what its stamps mean."""

import numpy as np

CYCLES = 2  # of the loop: the resolution of a stamp
HIGH, LOW, LENGTH = 2, 6, 8  # where a machine waits while its pin is high, low; instructions

_JMP_X, _JMP_PIN = 0x0040, 0x00C0  # RP2040 datasheet 3.4
_ISR_X, _PUSH, _NOP = 0xA0C1, 0x8000, 0xA042
_STAMP, _PASS_BY = (_ISR_X, _PUSH), (_NOP, _NOP)


def program(origin: int, both: bool) -> list[int]:
    """The instructions that stamp a pin's edges, or its rising edges alone, from `origin` on."""
    return [
        *_STAMP,
        _JMP_X | origin + HIGH + 1,
        _JMP_PIN | origin + HIGH,
        *(_STAMP if both else _PASS_BY),
        _JMP_X | origin + LOW + 1,
        _JMP_PIN | origin,
    ]


def times_ns(stamps: np.ndarray, both: bool, skip: int, clock_hz: int) -> np.ndarray:
    """Times of the edges of consecutive stamps, ns since the begin. skip: stamps before the first.

    A pass of the loop takes two cycles and counts one; an edge takes two more, counted by none, and
    so does a falling edge that is passed by.
    """
    before = np.append(0xFFFFFFFF, stamps[:-1]).astype(np.int64)
    passes = np.cumsum((before - stamps) & 0xFFFFFFFF)
    edges = (np.arange(len(stamps)) + skip) * (1 if both else 2)
    return (passes + edges) * (CYCLES * 1e9 / clock_hz)
