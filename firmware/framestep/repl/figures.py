"""timing(): the load of the board. live(): numbers for a program that asks repeatedly."""

from array import array

from framestep import boot, texts
from framestep.base.clock import WIDE_WRAP, elapsed
from framestep.base.native import CPYTHON, const, micropython, ptr32
from framestep.pulse.stepper import (
    ASKED,
    CLOCK,
    LATEST,
    PASSES,
    READ_INDEX,
    SEGMENTS,
    SHALLOWEST,
    SPENT,
    TICKS,
    WORST_LATE,
    WRITE_INDEX,
)
from framestep.repl.commands import dead

_QUIET_US = const(3)  # shorter gaps come from the measuring loop itself
_WINDOW_US = const(4000)  # watched at a time: passes wait meanwhile
_WINDOWS = const(50)
_LIVE_US = const(1000)  # of live(): a pass waits no longer than this
_LIVE_WINDOWS = const(3)


@micropython.viper
def _gaps(clock: ptr32, us: int, out: ptr32):
    """Watch a microsecond counter for `us`: out[0] += the total length of its gaps, out[1] = the
    longest gap."""
    begun = clock[0]
    last = begun
    while last - begun < us:
        now = clock[0]
        gap = now - last
        if gap > _QUIET_US:
            out[0] = out[0] + gap
            if gap > out[1]:
                out[1] = gap
        last = now


def timing():
    """Print how long a tick takes, how late it has been, and each moving motor's queue."""
    why = dead()
    if why:
        print(why)
        return
    kernel = boot.hal.kernel
    state = kernel.state
    if not CPYTHON:
        print(
            "interrupts: %d us in a tick of 1000 on average, %d us at a time at most"
            % _interrupts(state, _WINDOWS, _WINDOW_US)
        )
    asked = state[ASKED]
    ms = 0 if asked < 0 else elapsed(boot.controller.now, asked)
    load = (ms, state[SPENT], state[PASSES], state[WORST_LATE], state[LATEST], state[SHALLOWEST])
    for line in texts.load(*load):
        print(line)
    for motor, waiting in _queues(kernel):
        print("motor %d: %d of %d segments wait" % (motor, waiting, SEGMENTS))


def live():
    """Print the figures of timing() as a list: [µs of interrupts in a tick, µs of the longest,
    worst lateness of a tick in µs, its limit, segments that a queue holds, [[motor, waiting
    segments], …] of the moving motors, then counts of ms, of µs in ticks and of µs in passes, the
    latter modulo 2^30]. Takes three milliseconds; passes come in between."""
    why = dead()
    if why:
        print(why)
        return
    kernel = boot.hal.kernel
    state = kernel.state
    mean, longest = (0, 0) if CPYTHON else _interrupts(state, _LIVE_WINDOWS, _LIVE_US)
    counts = [boot.controller.now, state[SPENT], state[PASSES]]
    print([mean, longest, state[WORST_LATE], state[LATEST], SEGMENTS, _queues(kernel)] + counts)


def _interrupts(state, windows, us):
    """Measure interrupts in a number of windows of `us` each: (µs in a tick on average, µs of the
    longest)."""
    out = array("i", [0, 0])
    ticks = 0
    for _ in range(windows):
        before = state[TICKS]
        _gaps(state[CLOCK], us, out)
        ticks += elapsed(state[TICKS], before)
    return out[0] // max(ticks, 1), out[1]


def _queues(kernel):
    """Return [motor, waiting segments] of each motor that moves."""
    found = []
    for motor in range(boot.controller.axes.count):
        if boot.controller.axes[motor].moving:
            block = kernel.blocks[motor]
            found.append([motor + 1, (block[WRITE_INDEX] - block[READ_INDEX]) & WIDE_WRAP])
    return found
