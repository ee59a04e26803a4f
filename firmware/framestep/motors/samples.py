"""Positions of all loads at recent ticks, so that reported positions are of one moment.

The pins are some ticks behind the kernel, and a report has the positions as of pulses that have
been made. So each pass of the main loop keeps a sample of all positions, and so does each further
request that it answers. The newest sample whose pulses are out is reported; at rest a new one is
taken.
"""

from array import array

from framestep.base.clock import WRAP, elapsed, reached
from framestep.base.native import const, micropython, ptr32
from framestep.motors.backlash import BACKLASH, LOAD
from framestep.motors.backlash_rules import dragged
from framestep.pulse import engine
from framestep.pulse import stepper as sw

# Words of make_samples(), followed by rows of a tick and a position for each motor
_NEWEST = const(0)  # index of the newest row
ALARM = const(1)  # a tick, modulo 2^29, or -1
_ROW = const(2)  # words of a row
_END = const(3)
_ROWS = const(4)
_SAMPLES = const(7 + engine.BATCH)  # rows, of different ticks
_STALE = const(15 + engine.BATCH)  # ticks after which a sample is too old to be reported


def make_samples(motors):
    """Make the array for sample() and choose()."""
    row = 1 + motors
    words = array("i", [-_STALE & WRAP] * (_ROWS + _SAMPLES * row))
    words[_NEWEST] = _ROWS
    words[ALARM] = -1
    words[_ROW] = row
    words[_END] = len(words)
    return words


@micropython.viper
def sample(m: ptr32, out: ptr32) -> int:
    """Keep the last tick that was done, and each load's position by the commands queued until then.

    Updates the positions of the loads. Return whether the tick of the alarm is over. m: the header,
    in which it notes that there is a pass.
    """
    h = m
    h[sw.SKIP] = 0
    i = out[_NEWEST]
    if out[i + 0] != h[sw.TICKS]:
        i += out[_ROW]
        if i == out[_END]:
            i = _ROWS
        out[_NEWEST] = i
        tick = h[sw.TICKS] - 1
        while tick != h[sw.TICKS]:  # repeat if a tick came in between
            tick = h[sw.TICKS]
            k = i
            out[k] = tick
            a = h[sw.FIRST]
            while a:
                m = ptr32(a)
                a = m[sw.NEXT]
                k += 1
                motor = m[sw.POSITION]
                m = ptr32(m[sw.BACKLASH])
                load = m[LOAD]
                backlash = m[BACKLASH]
                load = dragged(load, backlash, motor)
                m[LOAD] = load
                out[k] = load
    if out[ALARM] >= 0:
        tick = out[i + 0]
        if engine.RING:  # ticks are done in batches, so the pins are farther behind
            tick += engine.LEAD - h[sw.BEHIND]
        if reached(tick, out[ALARM] + 1):
            return 1
    return 0


@micropython.viper
def choose(header, words, reported: ptr32) -> int:
    """reported = the loads' positions after the pulses made so far, from the samples kept.

    Return the tick (modulo 2^29) of the last of these pulses.
    """
    h = ptr32(header)
    running = 0
    a = h[sw.FIRST]
    while a:
        m = ptr32(a)
        a = m[sw.NEXT]
        running |= m[sw.MODE]
    if running == 0:
        sample(header, words)  # the last pulses are out
    out = ptr32(words)
    i = out[_NEWEST]
    tick = (h[sw.TICKS] - h[sw.BEHIND] - 1) & WRAP
    while running:
        age = elapsed(h[sw.TICKS], out[i + 0])
        if age > _STALE:
            # The main loop was away for long. The newest one is some ticks ahead of the pins.
            i = out[_NEWEST]
        elif age <= h[sw.BEHIND]:
            if i == _ROWS:
                i = out[_END]
            i -= out[_ROW]
            continue
        tick = out[i + 0]
        break
    k = 1
    while k < out[_ROW]:
        reported[k - 1] = out[i + k]
        k += 1
    return tick


@micropython.viper
def renumber(words: ptr32, motor: int, backlash: ptr32):
    """Put the new position of a motor at rest into all samples, as if it had been there before."""
    i = _ROWS + 1 + motor
    while i < words[_END]:
        words[i] = backlash[LOAD]
        i += words[_ROW]
