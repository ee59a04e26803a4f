"""What pulse/engine.py is for PIO, for an engine that is a stream of words in memory:
hal/stream.py.

The build puts this in that one's place for chips with such an engine. Its clock has 128 cycles a
microsecond, and each word lasts 512 of them: 4 µs, 250 words a tick. It has no time of its own
between commands, so most overheads are 0.
"""

from framestep.base.native import const

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
# the direction changes with a word, so the time to the next edge is rounded up to words
TURN_CYCLES = const(511)
SPARE_CYCLES = const(16)

# Time
LEAD = const(1)
SHORT_US = const(0)
TICK_COST_US = const(0)
CUE_DELAY_US = const(0)
COMMANDS = const(8)
BATCH = const(48)

RING = const(1)

# Of this engine alone
CYCLES = const(128000)  # in a tick
WORD_BITS = const(9)  # log2 of the cycles that a word lasts
WORDS = const(250)  # in a tick
