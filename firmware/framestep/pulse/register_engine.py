"""Constants of an engine that is a stream of words in memory, see hal/stream.py; here for a chip
that interrupts with each tick's words, and whose outputs are pins of its own.

Cycles and words are those of stream_engine.py. A tick's words begin to be sent AHEAD - 1 ticks
after it.
"""

from framestep.base.clock import WIDE_WRAP
from framestep.base.native import const, micropython, ptr32

# Fields of a command
DIRECTION = const(1)
PULSES = const(1)
GAP = const(10)
WIDTH = const(28)
WIDTHS = const(16)

# Cycles
FASTEST_HZ = const(128000000)
COMMAND_CYCLES = const(0)
WAIT_CYCLES = const(0)
LONGEST_WAIT = const(200000)
PERIOD_CYCLES = const(0)
HIGH_CYCLES = const(512)
WIDTH_CYCLES = const(512)
ROUND_CYCLES = const(1)  # its widths are enough
# The direction changes at a word, so the time to the next edge is rounded up to words.
TURN_CYCLES = const(511)
EDGE_CYCLES = const(0)  # it paints pulses only: levels would take it twice the time
EDGE_TURN_CYCLES = const(0)
SPARE_CYCLES = const(16)

# Time
LEAD = const(1)
AHEAD = const(3)  # ticks painted, with the one that is played
SHORT_US = const(0)
TICK_COST_US = const(0)
CUE_DELAY_US = const(-24)  # words wait in a FIFO for 36
COMMANDS = const(16)  # of two ticks, each with a pause for START, one for HOLD, and its pulses'
BATCH = const(3)
SINGLES = const(5)

MOTORS = const(16)  # with a word of 32 bits

RING = const(1)
OUTPUTS_IN_WORD = const(0)
CUE_TICKS = const(2)

# Only for engines that are streams
CYCLES = const(128000)  # in a tick
WORD_BITS = const(9)  # log2 of the cycles that a word lasts
WORDS = const(250)  # in a tick
SHIFT = const(0)
EARLY = const(0)


@micropython.viper
def pause(cycles: int) -> int:
    """Return the command for a wait, without its direction."""
    return (cycles - WAIT_CYCLES) << GAP


@micropython.viper
def put(fifo: ptr32, word: int):
    """See pulse/engine.py. Who reads the ring sees the count only once the word is there."""
    at = fifo[COMMANDS]
    fifo[at & (COMMANDS - 1)] = word
    fifo[COMMANDS] = (at + 1) & WIDE_WRAP
