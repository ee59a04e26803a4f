"""Constants of the engine that turns commands into edges, for the tick and the planner.

This is the engine of the RP2040 and RP2350, a PIO state machine for each motor (hal/rp2/pulses.py).
A chip with another engine has a module with the same names, and the build replaces this one by it:
see boards/chips.json and docs/internals/new-chip.md. The build folds imported constants and drops
the branches of the tick for other engines, and it puts what the functions do in the place of their
calls; so none of this costs anything.

A command is a 32-bit word with the fields below: direction, number of pulses, the gap before each,
and their width. The engine executes commands one after the other on its own clock. With n pulses,
the last rising edge comes

    COMMAND_CYCLES + n·(gap + PERIOD_CYCLES + width·WIDTH_CYCLES + rounds·ROUND_CYCLES)

after the rising edge before the command. Each pulse is
HIGH_CYCLES + width·WIDTH_CYCLES + rounds·ROUND_CYCLES high; a motor's rounds are none of a
command's fields, but set up at the start. A command without pulses is a wait of gap + WAIT_CYCLES.
The tick leaves at least SPARE_CYCLES from the end of a wait to the next edge.

If a motor's driver steps on both edges of its step input, a "pulse" is an edge, rising or falling.
It has no width, and takes EDGE_CYCLES in the place of all that is added to the gap above.
"""

from framestep.base.native import const, micropython, ptr32

# Fields of a command
DIRECTION = const(1)  # this bit: up, unless the motor's direction is inverted
PULSES = const(1)  # lowest bit of the number of pulses: 9 bits
GAP = const(10)  # 18 bits
WIDTH = const(28)  # 4 bits
WIDTHS = const(16)

# Cycles
FASTEST_HZ = const(131000000)  # fastest engine clock: a gap has to hold two ticks
COMMAND_CYCLES = const(4)
WAIT_CYCLES = const(9)
LONGEST_WAIT = const(200000)  # of one command
PERIOD_CYCLES = const(56)
HIGH_CYCLES = const(50)
WIDTH_CYCLES = const(25)
ROUND_CYCLES = const(425)
TURN_CYCLES = const(-1)  # from the end of a pulse to the next command's change of direction
EDGE_CYCLES = const(9)  # 0: this engine has no steps on both edges
EDGE_TURN_CYCLES = const(1)  # as TURN_CYCLES, from an edge that is a step
SPARE_CYCLES = const(16)

# Time. A tick needs up to three commands. The commands of LEAD + 1 ticks fit the FIFO once the
# engine has fetched one of them, which it has done SHORT_US after the tick at the latest.
LEAD = const(2)  # ticks from the tick that commands pulses to the pulses, less SHORT_US
SHORT_US = const(100)
TICK_COST_US = const(80)  # from a late tick's first line to the last motor's first command
CUE_DELAY_US = const(12)  # from the beginning of a tick to its change of outputs
COMMANDS = const(8)  # that can wait for each motor
BATCH = const(1)  # most ticks done at a time
SINGLES = const(0)  # most pulses of a tick that a ramp gives a command each; 0: 3, if there is room

MOTORS = const(24)  # at most; the build puts the chip's own number here (boards/chips.json)

# How commands and outputs leave the tick. RING 0: a command is written to a register of the motor.
# 1: each motor has a ring of COMMANDS words (a power of 2) in memory, followed by the count of
# words ever put. OUTPUTS_IN_WORD 0: one register raises the pins of a mask, another lowers them. 1:
# outputs are one word of levels, and all pins' bits lie below 2^30.
RING = const(0)
OUTPUTS_IN_WORD = const(0)
CUE_TICKS = const(0)  # by which outputs wait, since pulses come later than LEAD says


@micropython.viper
def pause(cycles: int) -> int:
    """Return the command for a wait, without its direction."""
    return (cycles - WAIT_CYCLES) << GAP


@micropython.viper
def put(fifo: ptr32, word: int):
    """Give a motor's engine a command."""
    fifo[0] = word
