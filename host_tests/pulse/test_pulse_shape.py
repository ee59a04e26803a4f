"""Pulses and pauses of the rig file in cycles of each engine: never shorter than asked, and no
longer than the engine's grid."""

import numpy as np
import pytest

from framestep.pulse import engine, shape, stream_engine

PIO_MHZ = (125, 100, 75)  # at 125, 200 and 150 MHz
ENGINES = [*((engine, mhz) for mhz in PIO_MHZ), (stream_engine, stream_engine.CYCLES // 1000)]
ROUNDING = 0.002  # cycles, of a float


@pytest.mark.parametrize("number", [float, np.float32], ids=["double", "single"])
@pytest.mark.parametrize(("module", "mhz"), ENGINES)
def test_never_shorter_than_asked(monkeypatch, module, mhz, number):
    for name in ("HIGH_CYCLES", "WIDTH_CYCLES", "WIDTHS"):
        monkeypatch.setattr(shape, name, getattr(module, name))
    for us in np.arange(0.25, 4.0005, 0.001):
        width, _ = shape.pulse_shape({"pulse_us": number(us), "setup_us": 0.0}, mhz)
        high = module.HIGH_CYCLES + width * module.WIDTH_CYCLES
        assert high >= us * mhz - ROUNDING, us
        assert width == 0 or high - module.WIDTH_CYCLES < us * mhz + ROUNDING, us
        assert 0 <= width < module.WIDTHS
    for us in np.arange(0.0, 200.05, 0.05):
        _, setup = shape.pulse_shape({"pulse_us": 1.0, "setup_us": number(us)}, mhz)
        assert us * mhz - ROUNDING <= setup < us * mhz + 1 + ROUNDING, us
