"""The shape of a motor's pulses in the engine's cycles. Only the start needs this."""

from framestep.pulse.engine import HIGH_CYCLES, ROUND_CYCLES, WIDTH_CYCLES, WIDTHS


def pulse_shape(settings, cycles_per_us):
    """Return the width, the set-up time and the hold time for StepKernel.configure() of a motor
    with these settings.

    Never shorter than asked: a driver may miss a shorter pulse.
    """
    wider = _up(settings["pulse_us"] * cycles_per_us) - HIGH_CYCLES
    rounds = max(0, -(((WIDTHS - 1) * WIDTH_CYCLES - wider) // ROUND_CYCLES))
    width = max(0, -((rounds * ROUND_CYCLES - wider) // WIDTH_CYCLES))
    return (
        rounds * WIDTHS + width,
        _up(settings["setup_us"] * cycles_per_us),
        _up(settings["hold_us"] * cycles_per_us),
    )


def _up(cycles):
    """Round up, except what a float adds to a whole number."""
    return int(cycles + 0.999)
