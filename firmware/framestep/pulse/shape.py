"""The shape of a motor's pulses in the engine's cycles. Only the start needs this."""

from framestep.pulse.engine import HIGH_CYCLES, WIDTH_CYCLES, WIDTHS


def pulse_shape(settings, cycles_per_us):
    """Return the width and the setup time for StepKernel.configure() of a motor with these
    settings.

    Never shorter than asked: a driver may miss a shorter pulse.
    """
    high = _up(settings["pulse_us"] * cycles_per_us)
    width = -((HIGH_CYCLES - high) // WIDTH_CYCLES)
    return max(0, min(WIDTHS - 1, width)), _up(settings["setup_us"] * cycles_per_us)


def _up(cycles):
    """Round up, except what a float adds to a whole number."""
    return int(cycles + 0.999)
