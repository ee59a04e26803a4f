"""The shape of a motor's pulses in the engine's cycles. Only the start needs this."""

from framestep.pulse.engine import HIGH_CYCLES, ROUND_CYCLES, WIDTH_CYCLES, WIDTHS


def pulse_shape(settings, cycles_per_us):
    """Return the arguments of StepKernel.configure() from `width` on, for a motor with these
    settings.

    No time is shorter than asked: a driver may miss a shorter pulse.
    """
    high = _up(settings["pulse_us"] * cycles_per_us)
    both_edges = settings["driver"] and settings["driver"]["both_edges"]
    wider = 0 if both_edges else high - HIGH_CYCLES
    rounds = max(0, -(((WIDTHS - 1) * WIDTH_CYCLES - wider) // ROUND_CYCLES))
    width = max(0, -((rounds * ROUND_CYCLES - wider) // WIDTH_CYCLES))
    return (
        rounds * WIDTHS + width,
        _up(settings["setup_us"] * cycles_per_us),
        settings["invert"],
        _up(settings["hold_us"] * cycles_per_us),
        high if both_edges else 0,
    )


def _up(cycles):
    """Round up, except what a float adds to a whole number."""
    return int(cycles + 0.999)
