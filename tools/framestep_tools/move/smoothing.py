"""Smoothing of noisy positions: a Savitzky-Golay filter."""

from collections.abc import Sequence

FEWEST = 5  # frames: fewer have a cubic through all of them
MOST = 999
_DEGREE = 3


def smoothed(values: Sequence[float], frames: int) -> list[float]:
    """Return each value as the cubic has it that is nearest to the `frames` values around it.

    frames: odd, at most as many as there are values. Near the ends the first and the last cubic go
    on. Needs scipy.
    """
    from scipy.signal import savgol_filter

    return [float(value) for value in savgol_filter(values, frames, _DEGREE, mode="interp")]
