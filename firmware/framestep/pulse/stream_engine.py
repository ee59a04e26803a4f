"""Constants of an engine that is a stream of words in memory, see hal/stream.py; here as an ESP32
sends them, ticks in batches from the main loop.

For chips with such an engine the build puts this module in the place of pulse/engine.py. Its clock
has 128 cycles per microsecond. A word lasts 512 of them, 4 µs, so a tick has 250 words. Commands
follow one another without a pause, so most overheads are 0.
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
SHORT_US = const(0)
TICK_COST_US = const(0)
CUE_DELAY_US = const(0)
COMMANDS = const(8)
BATCH = const(48)
SINGLES = const(0)

MOTORS = const(24)

RING = const(1)
OUTPUTS_IN_WORD = const(1)
CUE_TICKS = const(0)

# Only for engines that are streams
CYCLES = const(128000)  # in a tick
WORD_BITS = const(9)  # log2 of the cycles that a word lasts
WORDS = const(250)  # in a tick
SHIFT = const(1)  # level n is bit n + SHIFT of a word
EARLY = const(15)  # levels from this one on leave a word early; 0: none do


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
