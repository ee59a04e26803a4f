"""A trace as a Value Change Dump (IEEE 1364-2005, 18), for GTKWave, PulseView and other waveform
viewers.

A trace has the rising edge of each step (trace.py), not the falling one. In the dump a step's pulse
ends after `pulse_ns`, or half-way to the next step if that is sooner, so pulses stay separate.
"""

from typing import TextIO

import numpy as np
from vcd import VCDWriter

from .trace import Trace

PULSE_NS = 1000  # the rig file's default


def write(trace: Trace, file: TextIO, pulse_ns: int = PULSE_NS) -> int:
    """Write the dump. Return the number of its changes.

    Signals: `step1`, … are pulses; `position1`, … are steps counted from the trace's start (a
    signed number of 32 bits); all others are levels with their names in the trace. Times are
    nanoseconds of the board's clock. Takes memory for all changes at once, some 40 bytes each.
    """
    with VCDWriter(
        file, timescale="1 ns", comment="a trace of framestep", check_values=False
    ) as out:
        variables, columns = [], []

        def change(variable: object, times: np.ndarray, values: np.ndarray) -> None:
            columns.append(np.column_stack((times, np.full(len(times), len(variables)), values)))
            variables.append(variable)

        for motor in trace.motors:
            times, _ = trace.steps(motor)
            ends = times + np.minimum(
                pulse_ns, np.diff(times, append=times[-1] + 2 * pulse_ns) // 2
            )
            pulses = np.stack((times, ends), 1).ravel()
            step = out.register_var("framestep", f"step{motor}", "wire", size=1, init=0)
            change(step, pulses, np.tile((1, 0), len(times)))
            position = out.register_var("framestep", f"position{motor}", "integer", size=32, init=0)
            change(position, *trace.positions(motor))
        for name, (times, levels) in sorted(trace.signals.items()):
            if not name.startswith("m") or not name[1:].isdecimal():
                change(out.register_var("framestep", name, "wire", size=1, init="x"), times, levels)
        rows = np.concatenate([np.zeros((0, 3), np.int64), *columns])
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
        for time_ns, number, value in rows.tolist():
            out.change(variables[number], time_ns, value)
    return len(rows)
