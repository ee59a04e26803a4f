"""Pulses and pauses of the rig file in cycles of each engine: never shorter than asked, and no
longer than the engine's grid."""

import numpy as np
import pytest

from framestep.pulse import engine, kernel, shape, stream_engine

PIO_MHZ = (125, 100, 75)  # at 125, 200 and 150 MHz
ENGINES = [*((engine, mhz) for mhz in PIO_MHZ), (stream_engine, stream_engine.CYCLES // 1000)]
MOST_ROUNDS = 14  # bits that an OSR has left behind the gap
ROUNDING = 0.002  # cycles, of a float


@pytest.mark.parametrize("number", [float, np.float32], ids=["double", "single"])
@pytest.mark.parametrize(("module", "mhz"), ENGINES)
def test_never_shorter_than_asked(monkeypatch, module, mhz, number):
    for name in ("HIGH_CYCLES", "WIDTH_CYCLES", "ROUND_CYCLES", "WIDTHS"):
        monkeypatch.setattr(shape, name, getattr(module, name))
    for name in ("WIDTH_CYCLES", "ROUND_CYCLES", "WIDTHS"):
        monkeypatch.setattr(kernel.engine, name, getattr(module, name))
    rounds = MOST_ROUNDS if module is engine else 0
    lengths = [module.HIGH_CYCLES + kernel.wider(k) for k in range((rounds + 1) * module.WIDTHS)]
    lengths.sort()
    for us in np.arange(0.25, 50.0005, 0.01):
        width, *_ = shape.pulse_shape(asked(number, pulse_us=us), mhz)
        high = module.HIGH_CYCLES + kernel.wider(width)
        assert high >= us * mhz - ROUNDING, us
        shorter = [length for length in lengths if length < high]
        assert not shorter or shorter[-1] < us * mhz + ROUNDING, us
        assert high in lengths
    for us in np.arange(0.0, 200.05, 0.05):
        _, setup, _, hold, _ = shape.pulse_shape(asked(number, setup_us=us, hold_us=us), mhz)
        assert us * mhz - ROUNDING <= setup < us * mhz + 1 + ROUNDING, us
        assert hold == setup


def asked(number, **settings):
    settings = {"pulse_us": 1.0, "setup_us": 5.0, "hold_us": 0.0, **settings}
    found = {key: number(value) for key, value in settings.items()}
    return {**found, "invert": False, "driver": None}


@pytest.mark.parametrize("mhz", PIO_MHZ)
def test_edges_that_are_steps_are_as_far_apart_as_asked(mhz):
    """They have no width, whatever is asked: in a command it would lengthen the gap."""
    for us in (0.25, 1.0, 50.0):
        settings = asked(float, pulse_us=us) | {"driver": {"both_edges": True}}
        width, *_, apart = shape.pulse_shape(settings, mhz)
        assert width == 0
        assert us * mhz - ROUNDING <= apart < us * mhz + 1
        settings["driver"] = {"both_edges": False}
        assert shape.pulse_shape(settings, mhz)[-1] == 0


@pytest.mark.parametrize("mhz", PIO_MHZ)
def test_the_default_pulse_is_exact(mhz):
    """So a motor with default settings reaches 500 000 steps/s at each clock."""
    width, *_ = shape.pulse_shape(asked(float), mhz)
    assert engine.HIGH_CYCLES + kernel.wider(width) == mhz
