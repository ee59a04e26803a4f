"""Phases cut into segments with the heap locked."""

SCRIPT = """
from array import array

import micropython

from framestep.base.native import addressof
from framestep.motion import phases, reals
from framestep.motors.axis import Axis
from framestep.pulse import stepper
from framestep.pulse.kernel import StepKernel

clock = array("i", [0])
sink = array("i", [0])
kernel = StepKernel(1, 125000, addressof(clock))
kernel.configure(0, addressof(sink), 3, 100, False)
axis = Axis(kernel, 0, None)
words = axis.phases.words
for i, quarters in enumerate((41, 3, 20)):
    at = i * phases.PHASE_WORDS
    words[at + phases.KIND] = phases.RAMP
    reals.put(words, at + phases.DURATION, quarters, -2)
    for register in (phases.START, phases.SECOND, phases.THIRD):
        reals.put(words, at + register, 0, 0)
words[phases.WRITE_INDEX] = 3
axis.block[stepper.PLANNED] |= stepper.PLAN_SEGMENTS
micropython.heap_lock()
axis.feed()
micropython.heap_unlock()
tail = axis.block[stepper.WRITE_INDEX]
print(tail)
"""


def test_a_short_phase_that_ends_with_the_tick(runtime):
    """10.25 ticks, then 0.75: 2^30 parts of the tick are over, and that number is a heap object."""
    assert int(runtime.run(SCRIPT)) >= 4
