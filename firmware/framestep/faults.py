"""Why motors were stopped, as text. Always loaded, as it is printed where nothing may be imported
or allocated."""

from framestep.pulse.stepper import FAULT_DRY, FAULT_LATE, FAULT_PIN
from framestep.stops import (
    FAULT_CLOCK,
    FAULT_DRIVER,
    FAULT_ESTOP,
    FAULT_LIMIT,
    FAULT_LOST,
    FAULT_TAKEN,
)

FAULTS = (
    (FAULT_DRY, "a motor's queue ran dry in a motion"),
    (FAULT_LATE, "the interrupt came too late, so pulses broke off"),
    (FAULT_PIN, "a segment did not begin where its motor was"),
    (FAULT_LOST, "a pulse command was lost, so steps are missing"),
    (FAULT_ESTOP, "the E-stop was pressed"),
    (FAULT_LIMIT, "a limit switch was hit"),
    (FAULT_DRIVER, "a driver failed"),
    (FAULT_TAKEN, "something else had taken a pin, which was put back"),
    (FAULT_CLOCK, "a program changed the processor's clock"),
)
ALL = "; the motors were ramped down"
_ONE = "; its motor was ramped down"


def outcome(bit, moved):
    """Return the end of a fault's line: what the fault led to. moved: FaultLog.moved."""
    if bit & moved:
        return _ONE if bit == FAULT_LIMIT else ALL
    return ""
