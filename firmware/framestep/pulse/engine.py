"""What the tick and the planner have to know of the engine that turns commands into edges.

This is the engine of the RP2040 and RP2350, a PIO state machine for each motor (hal/rp2/pulses.py).
A chip with another engine has a module with the same names, and the build replaces this one by it:
see boards/chips.json and docs/internals/new-chip.md. The build folds imported constants and drops
the branches of the tick for other engines, so neither costs anything.

A command is a 32-bit word with the fields below: the direction, how many pulses, the gap before
each, how wide they are. The engine executes one after the other on its own clock. With n pulses,
the last rising edge comes

    COMMAND_CYCLES + n·(gap + PERIOD_CYCLES + width·WIDTH_CYCLES)

after the rising edge before the command; each pulse is HIGH_CYCLES + width·WIDTH_CYCLES high.
Without pulses the command is a wait of gap + WAIT_CYCLES. The tick leaves SPARE_CYCLES at least
from the end of a wait to the next edge.
"""

from framestep.base.native import const

# Fields of a command
DIRECTION = const(1)  # this bit: up, unless the motor's direction is inverted
PULSES = const(1)  # where the number of pulses begins: 9 bits
GAP = const(10)  # 18 bits
WIDTH = const(28)  # 4 bits
WIDTHS = const(16)

# Cycles
FASTEST_HZ = const(131000000)  # of the engine's clock: a gap has to hold two ticks
COMMAND_CYCLES = const(4)
WAIT_CYCLES = const(9)
LONGEST_WAIT = const(200000)  # that one command can make
PERIOD_CYCLES = const(40)
HIGH_CYCLES = const(34)
WIDTH_CYCLES = const(32)
TURN_CYCLES = const(-1)  # from the end of a pulse to where the next command changes the direction
SPARE_CYCLES = const(16)

# Time. A tick takes up to three commands, and those of LEAD + 1 ticks fit what can wait when the
# engine has fetched one of them; SHORT_US is the time by which it is sure to have done so.
LEAD = const(2)  # ticks from the tick that commands pulses to these pulses, less SHORT_US
SHORT_US = const(100)
TICK_COST_US = const(80)  # from a late tick's first line to the last motor's first command
CUE_DELAY_US = const(12)  # from the beginning of a tick to its change of outputs
COMMANDS = const(8)  # that can wait for each motor
BATCH = const(1)  # ticks done at a time, at most

# How commands and outputs get out. 0: a command is written to a register of the motor, outputs
# change by a register that raises the pins of a mask and one that lowers them. 1: each motor has a
# ring of COMMANDS words (a power of 2) in memory with the count of those ever put behind it,
# outputs are a word of levels; all the pins' bits lie below 2^30.
RING = const(0)
