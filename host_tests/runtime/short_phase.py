"""Runs on MicroPython: a phase of 0.75 ticks ends with its tick, with the heap locked."""

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
