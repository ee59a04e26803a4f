"""The two rules of backlash, for the plan, the check of a path, and the reported positions alike.

Only kernels use them. As with base/clock.py, the build replaces each call by its expression.
"""

from framestep.base.native import micropython


@micropython.viper
def turned(offset: int, backlash: int, before: int, load: int) -> int:
    """Return the offset of the motor once the load has gone from `before` to `load`."""
    return 0 if load > before else 0 - backlash if load < before else offset


@micropython.viper
def dragged(load: int, backlash: int, motor: int) -> int:
    """Return the load's position once the motor has gone to `motor`."""
    return motor if load < motor else motor + backlash if load - motor > backlash else load
