"""The two rules of backlash, for the plan, the check of a path, and the reported positions alike.

Both are used in kernels alone. As with base/clock.py, the build puts what they compute in the place
of each call.
"""

from framestep.base.native import micropython


@micropython.viper
def turned(offset: int, backlash: int, before: int, load: int) -> int:
    """The offset from the load to the motor once the load has gone from `before` to `load`."""
    return 0 if load > before else 0 - backlash if load < before else offset


@micropython.viper
def dragged(load: int, backlash: int, motor: int) -> int:
    """Where the load is once the motor has gone to `motor`."""
    return motor if load < motor else motor + backlash if load - motor > backlash else load
