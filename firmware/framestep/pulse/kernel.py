"""The step kernel as an object: makes the words that stepper.py names and the tick works on."""

from array import array

from framestep.base.clock import WRAP
from framestep.base.native import addressof, as_word
from framestep.pulse import engine
from framestep.pulse import stepper as sw
from framestep.pulse.tick import Header


def wider(width):
    """Return the cycles by which a pulse of this width is longer than the shortest. See
    StepKernel.configure()."""
    return (
        width % engine.WIDTHS * engine.WIDTH_CYCLES + width // engine.WIDTHS * engine.ROUND_CYCLES
    )


class StepKernel:
    """State blocks for `motors` motors and the tick function over them.

    cycles: engine cycles per tick, a multiple of 1000, at most engine.FASTEST_HZ // 1000.
    clock: address of a microsecond counter (on CPython: of any object with an item 0).
    """

    def __init__(self, motors, cycles, clock):
        self.motors = motors

        self.state = Header("i", [0] * sw.HEADER_WORDS)
        self.tick = self.state.tick
        self.blocks = [array("i", [0] * sw.BLOCK_WORDS) for _ in range(motors)]
        self.queues = [array("i", [0] * (sw.SEGMENTS * sw.SEGMENT_WORDS)) for _ in range(motors)]
        state = self.state
        state[sw.CLOCK] = as_word(clock)
        state[sw.CYCLES] = cycles
        state[sw.CYCLES_PER_US] = cycles // sw.TICK_US
        state[sw.LEAD] = state[sw.BEHIND] = engine.LEAD
        state[sw.AHEAD] = engine.LEAD * cycles - engine.SHORT_US * state[sw.CYCLES_PER_US]
        state[sw.SQUARE] = (1 << 25) // cycles
        state[sw.SHALLOWEST] = sw.UNSTRAINED
        state[sw.ASKED] = state[sw.AWAKE_AT] = -1
        following = 0
        for i in range(motors - 1, -1, -1):
            block = self.blocks[i]
            block[sw.NEXT] = following
            following = as_word(addressof(block))
            block[sw.QUEUE] = as_word(addressof(self.queues[i]))
            block[sw.BRAKE] = sw.ONE // 50
            block[sw.IDLE_AT] = -1000
            block[sw.SPAN] = block[sw.WHOLE_SPAN] = cycles
        state[sw.FIRST] = following
        self.cues = array("i", [0] * (sw.CUE_WORDS * sw.CUE_SLOTS))
        self._nowhere = array("i", [0])
        state[sw.CUES] = as_word(addressof(self.cues))
        state[sw.OUT_SET] = state[sw.OUT_CLEAR] = as_word(addressof(self._nowhere))

    def outputs(self, set_address, clear_address):
        """Set where cues go: registers that raise and lower the output pins of a mask, or the word
        of levels twice."""
        self.state[sw.OUT_SET] = as_word(set_address)
        self.state[sw.OUT_CLEAR] = as_word(clear_address)

    def cue(self, tick, raised, lowered):
        """Change output pins in a tick (modulo 2^29), not earlier than in the cues before.

        raised, lowered: masks of pins, below 2^30. The pins change some microseconds after the
        tick is due. Return False if there is no room.
        """
        state = self.state
        if (state[sw.CUE_WRITE_INDEX] - state[sw.CUE_READ_INDEX]) & WRAP >= sw.CUE_SLOTS:
            return False
        k = (state[sw.CUE_WRITE_INDEX] & (sw.CUE_SLOTS - 1)) * sw.CUE_WORDS
        cues = self.cues
        cues[k + sw.CUE_TICK] = (tick + engine.CUE_TICKS) & WRAP
        cues[k + sw.CUE_RAISED] = raised
        cues[k + sw.CUE_LOWERED] = lowered
        state[sw.CUE_WRITE_INDEX] = (state[sw.CUE_WRITE_INDEX] + 1) & WRAP
        return True

    def drop_cues(self):
        """Drop the cues that have not been given. To be called with interrupts off."""
        self.state[sw.CUE_WRITE_INDEX] = self.state[sw.CUE_READ_INDEX]

    def configure(self, motor, fifo, width, setup, invert, hold=0, apart=0):
        """Set a motor's pulse shape.

        fifo: where its commands go, see engine.RING. width: that of a command, plus engine.WIDTHS
        for each of the engine's rounds. setup: cycles from a change of direction to the next rising
        edge. hold: cycles from the end of a pulse to a change of direction. A pulse, setup and hold
        may take a third of a tick together. invert: swap direction. apart: cycles from one edge to
        the next if the driver steps on both, and width is 0; else 0.
        """
        state = self.state
        block = self.blocks[motor]
        longer = wider(width)
        high = engine.HIGH_CYCLES + longer
        width %= engine.WIDTHS
        block[sw.FIFO] = as_word(fifo)
        signed = width - engine.WIDTHS if width >= engine.WIDTHS // 2 else width
        block[sw.WORD] = (signed << engine.WIDTH) + (0 if invert else engine.DIRECTION)
        block[sw.DOWN] = 0
        block[sw.FIXED] = engine.EDGE_CYCLES if apart else engine.PERIOD_CYCLES + longer
        block[sw.SHORTEST] = apart or 2 * high
        turn = setup + (engine.EDGE_TURN_CYCLES if apart else high + engine.TURN_CYCLES)
        block[sw.SETUP] = max(turn, block[sw.SHORTEST])
        block[sw.HOLD] = max(hold, engine.WAIT_CYCLES) if hold else 0
        block[sw.RESERVE] = block[sw.SETUP] + block[sw.HOLD] + engine.SPARE_CYCLES
        reserve = max(b[sw.RESERVE] for b in self.blocks)
        state[sw.LATEST] = (state[sw.AHEAD] - reserve) // state[
            sw.CYCLES_PER_US
        ] - engine.TICK_COST_US
