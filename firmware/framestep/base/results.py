"""Results of a request or a move: OK or an error. All layers may use them.

The numbers are the protocol's response codes. The protocol imports them from here, so answers need
no table.
"""

from framestep.base.native import const

OK = const(0x0010)
ERR_MOVING = const(0x0012)
ERR_RANGE = const(0x0014)
ERR_GENERAL = const(0x0015)
ERR_NOT_IN_POSITION = const(0x0016)
ERR_PREROLL = const(0x0017)
ERR_POSTROLL = const(0x0018)
ERR_AIM_COD = const(0x0019)  # field note 3.2: aim point inside the safe distance
ERR_SOFT_UP = const(0x0020)
ERR_SOFT_LOW = const(0x0021)
ERR_HARD_UP = const(0x0022)
ERR_HARD_LOW = const(0x0023)

# The limit that the last move exceeded: words of `exceeded` (moves/path/move_check.py)
WHAT = const(0)  # EXCEEDED_
MOTOR = const(1)
FRAME = const(2)  # scene frame
# excess in steps/s or steps/s²; SLOWED: the rate used, thousandths of a frame per second; MEMORY:
# the bytes needed
BY = const(3)
ROOM = const(4)  # MEMORY: the bytes that were free; RATE: the greatest
EXCEEDED_WORDS = const(5)

EXCEEDED_NOTHING = const(0)
EXCEEDED_VELOCITY = const(1)  # refused
EXCEEDED_ACCELERATION = const(2)  # refused with `strict_moves` only
EXCEEDED_BOARD = const(3)  # refused: beyond what the board can make
EXCEEDED_SLOWED = const(4)  # JOG_ALL goes slower than requested
EXCEEDED_UPPER = const(5)  # refused: beyond the upper soft limit
EXCEEDED_LOWER = const(6)  # refused: beyond the lower soft limit
EXCEEDED_PREROLL = const(7)  # refused: a limit or the acceleration in the pre-roll
EXCEEDED_POSTROLL = const(8)  # refused: a limit or the acceleration in the post-roll
EXCEEDED_MEMORY = const(9)  # refused: the upload does not fit
# refused: too many frames per second; BY asked, ROOM possible, in thousandths
EXCEEDED_RATE = const(10)
