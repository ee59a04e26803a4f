"""Velocities and accelerations of motors: limits, defaults, and where a motor keeps its own."""

from framestep.base.native import const

TICKS_PER_SECOND = const(1000)
VELOCITY_FLOOR = const(10)  # steps/s: lower settings are raised to this (field note 4.1)
VELOCITY_LIMIT = const(500000)  # steps/s: limit of the kernel's numbers
ACCELERATION_LIMIT = const(4000000)  # steps/s²: likewise; higher settings are lowered to this
DEFAULT_VELOCITY = const(5000)  # field note 4.1
DEFAULT_ACCELERATION = const(20000)

# Registers of Axis.numbers
MAX_VELOCITY = const(0)  # steps per tick
MAX_ACCELERATION = const(2)  # steps per tick²
MAX_JERK = const(4)  # steps per tick³, 0 for no limit


def kernel_rate(acceleration):
    """Return the kernel's deceleration, Q22 steps per tick², at least 1.

    acceleration: steps/s², ACCELERATION_LIMIT at most.
    """
    rate = acceleration * 4 + acceleration * 199 // 1024  # 2^22 / 10^6 = 4.194304
    return rate if rate else 1
