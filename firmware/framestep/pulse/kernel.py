"""The step kernel as an object: makes the words that stepper.py names, for the tick to work on."""

from array import array

from framestep.base.clock import WRAP
from framestep.base.native import addressof, as_word
from framestep.pulse import engine
from framestep.pulse.stepper import (
    AHEAD,
    BEHIND,
    BLOCK_WORDS,
    BRAKE,
    CLOCK,
    CUE_LOWERED,
    CUE_RAISED,
    CUE_READ_INDEX,
    CUE_SLOTS,
    CUE_TICK,
    CUE_WRITE_INDEX,
    CUES,
    CYCLES,
    CYCLES_PER_US,
    DECEL,
    DOWN,
    FIFO,
    FIRST,
    FIXED,
    HEADER_WORDS,
    IDLE_AT,
    INVERT,
    LATEST,
    LEAD,
    NEXT,
    ONE,
    OUT_CLEAR,
    OUT_SET,
    QUEUE,
    RESERVE,
    SEGMENT_WORDS,
    SEGMENTS,
    SETUP,
    SHORTEST,
    SPAN,
    SQUARE,
    TICK_US,
    WHOLE_SPAN,
    WORD,
)
from framestep.pulse.tick import Header


class StepKernel:
    """State blocks for `motors` motors and the tick function over them.

    cycles: engine cycles per tick, a multiple of 1000, at most engine.FASTEST_HZ // 1000.
    clock: address of a microsecond counter (on CPython: of anything that can be indexed with 0).
    """

    def __init__(self, motors, cycles, clock):
        self.motors = motors

        self.state = Header("i", [0] * HEADER_WORDS)
        self.tick = self.state.tick
        self.blocks = [array("i", [0] * BLOCK_WORDS) for _ in range(motors)]
        self.queues = [array("i", [0] * (SEGMENTS * SEGMENT_WORDS)) for _ in range(motors)]
        state = self.state
        state[CLOCK] = as_word(clock)
        state[CYCLES] = cycles
        state[CYCLES_PER_US] = cycles // TICK_US
        state[LEAD] = state[BEHIND] = engine.LEAD
        state[AHEAD] = engine.LEAD * cycles - engine.SHORT_US * state[CYCLES_PER_US]
        state[SQUARE] = (1 << 25) // cycles
        following = 0
        for i in range(motors - 1, -1, -1):
            block = self.blocks[i]
            block[NEXT] = following
            following = as_word(addressof(block))
            block[QUEUE] = as_word(addressof(self.queues[i]))
            block[BRAKE] = block[DECEL] = ONE // 50
            block[IDLE_AT] = -1000
            block[SPAN] = block[WHOLE_SPAN] = cycles
        state[FIRST] = following
        self.cues = array("i", [0] * (4 * CUE_SLOTS))
        self._nowhere = array("i", [0])
        state[CUES] = as_word(addressof(self.cues))
        state[OUT_SET] = state[OUT_CLEAR] = as_word(addressof(self._nowhere))

    def outputs(self, set_address, clear_address):
        """Where cues go: registers that raise and lower the output pins of a mask, or the word of
        levels twice."""
        self.state[OUT_SET] = as_word(set_address)
        self.state[OUT_CLEAR] = as_word(clear_address)

    def cue(self, tick, raised, lowered):
        """Change output pins in a tick (modulo 2^29), not before the cues put until now.

        raised, lowered: masks of pins, below 2^30. The pins change some microseconds after the
        tick is due. False where there is no room.
        """
        state = self.state
        if (state[CUE_WRITE_INDEX] - state[CUE_READ_INDEX]) & WRAP >= CUE_SLOTS:
            return False
        k = (state[CUE_WRITE_INDEX] & (CUE_SLOTS - 1)) << 2
        cues = self.cues
        cues[k + CUE_TICK] = tick & WRAP
        cues[k + CUE_RAISED] = raised
        cues[k + CUE_LOWERED] = lowered
        state[CUE_WRITE_INDEX] = (state[CUE_WRITE_INDEX] + 1) & WRAP
        return True

    def drop_cues(self):
        """Forget the cues that have not been given. Interrupts are off."""
        self.state[CUE_WRITE_INDEX] = self.state[CUE_READ_INDEX]

    def configure(self, motor, fifo, width, setup, invert):
        """Set a motor's pulse shape.

        fifo: where its commands go, see engine.RING. width: 0 … engine.WIDTHS - 1.
        setup: cycles from a change of direction to the next rising edge, up to a quarter of a tick.
        invert: swap direction.
        """
        state = self.state
        block = self.blocks[motor]
        wider = engine.WIDTH_CYCLES * width
        high = engine.HIGH_CYCLES + wider
        block[FIFO] = as_word(fifo)
        signed = width - engine.WIDTHS if width >= engine.WIDTHS // 2 else width
        block[WORD] = (signed << engine.WIDTH) + (0 if invert else engine.DIRECTION)
        block[DOWN] = 0
        block[FIXED] = engine.PERIOD_CYCLES + wider
        block[SHORTEST] = 2 * high
        block[SETUP] = max(setup + high + engine.TURN_CYCLES, 2 * high)
        block[RESERVE] = block[SETUP] + engine.SPARE_CYCLES
        block[INVERT] = engine.DIRECTION if invert else 0
        reserve = max(b[RESERVE] for b in self.blocks)
        state[LATEST] = (state[AHEAD] - reserve) // state[CYCLES_PER_US] - engine.TICK_COST_US
