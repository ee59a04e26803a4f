"""Conditions as text: for the REPL, and for `framestep status` on the host. Loaded on demand.
Allocates."""

from framestep.base.native import const
from framestep.faults import FAULTS, outcome
from framestep.motors.positions import (
    BEFORE,
    BROKEN_OFF,
    DRIVER,
    DRIVER_OFF,
    HELD,
    HOMED,
    HOMING,
    KNOWN,
    LOST,
    NOT_FOUND,
    NOT_OPENED,
    NOT_SQUARE,
    RESTORED,
    SERVO,
    SET,
    STEPS,
    UNPOWERED,
    UNSET,
)
from framestep.protocol.messages import (
    CONDITION_CLOCK,
    CONDITION_DRIVER,
    CONDITION_ESTOP,
    CONDITION_EXCEEDED,
    CONDITION_LOAD,
    CONDITION_OVERLAY,
    CONDITION_OVERLAY_LEFT_OUT,
    CONDITION_POSITIONS_PENDING,
    CONDITION_POSITIONS_SAVED,
    CONDITION_POSITIONS_UNSAVABLE,
    CONDITION_RIG_FILE_INVALID,
    CONDITION_WATCHDOG_RESET,
    EXCEEDED_ACCELERATION,
    EXCEEDED_BOARD,
    EXCEEDED_LOWER,
    EXCEEDED_MEMORY,
    EXCEEDED_POSTROLL,
    EXCEEDED_PREROLL,
    EXCEEDED_RATE,
    EXCEEDED_SLOWED,
    EXCEEDED_UPPER,
    EXCEEDED_VELOCITY,
)
from framestep.pulse.stepper import UNSTRAINED

STATES = {LOST: "lost", HELD: "held", KNOWN: "known"}
REASONS = {
    UNSET: "not set since power-up",
    STEPS: "steps were not made",
    BROKEN_OFF: "the power or the firmware failed while motors moved",
    BEFORE: "lost before the power failed",
    RESTORED: "restored from before power-up",
    DRIVER_OFF: "the driver has been off since it was known",
    SET: "set by the host",
    DRIVER: "its driver has failed",
    UNPOWERED: "the E-stop cut the power in motion",
    HOMED: "set by homing",
    HOMING: "homing was begun and has not been completed",
    NOT_FOUND: "homing did not find its switch",
    NOT_OPENED: "its home switch did not open",
    NOT_SQUARE: "its home switch was too far away when the other side had found its own",
    SERVO: "a servo goes where its pulses say",
}
_LONGEST_MS = const(1 << 20)  # the counts of MSG_LOAD wrap after 2^30 us
CONDITIONS = {
    CONDITION_RIG_FILE_INVALID: "the rig file has a mistake: nothing moves (the REPL shows it)",
    CONDITION_ESTOP: "the E-stop is held",
    CONDITION_POSITIONS_SAVED: "positions are saved: the power may be cut",
    CONDITION_POSITIONS_PENDING: (
        "positions are not saved yet: wait until the motors have rested for 2 seconds"
    ),
    CONDITION_POSITIONS_UNSAVABLE: "positions cannot be saved: the flash or its files fail",
    CONDITION_WATCHDOG_RESET: (
        "the watchdog restarted the board: the firmware hung while motors moved"
    ),
    CONDITION_EXCEEDED: "the last move exceeds a motor's limits, or does not fit into memory",
    CONDITION_DRIVER: "a driver does not work and its motor does not move (the REPL says why)",
    CONDITION_OVERLAY: "an overlay is in use: edited modules replace the image's (framestep flash)",
    CONDITION_OVERLAY_LEFT_OUT: (
        "an overlay was left out: the image's own modules run (framestep flash, or flash --clean)"
    ),
    CONDITION_LOAD: (
        "the board is close to its limit: a tick was late, or a motor had little queued; "
        "fewer steps/s, fewer motors or a higher clock_mhz help"
    ),
    CONDITION_CLOCK: (
        "a program changed the processor's clock (machine.freq, lightsleep): nothing moves until "
        "it is as before, or the board is reset"
    ),
}
LIMITS_COUNT = "soft limits do not protect a motor whose position is lost; RESET_POSITION sets it"


def trust(state, reason):
    """Return the text of a state and its reason, such as "lost: not set since power-up"."""
    return "%s: %s" % (
        STATES.get(state, "state %d" % state),
        REASONS.get(reason, "reason %d" % reason),
    )


EXCEEDED = {
    EXCEEDED_VELOCITY: "its velocity by %d steps/s: refused",
    EXCEEDED_ACCELERATION: "its acceleration by %d steps/s²; it is refused with strict_moves only",
    EXCEEDED_BOARD: "what the board can make: refused",
    EXCEEDED_SLOWED: "its limits: JOG_ALL goes at %d frames in 1000 s",
    EXCEEDED_UPPER: "its upper soft limit: refused",
    EXCEEDED_LOWER: "its lower soft limit: refused",
    EXCEEDED_PREROLL: "a limit or its acceleration in the pre-roll: refused",
    EXCEEDED_POSTROLL: "a limit or its acceleration in the post-roll: refused",
}


def exceeded(what, motor, frame, by, room=0):
    """Return a list with a line about what the last move exceeds, or an empty list.

    what: EXCEEDED_. motor: from 1. by, room: see framestep.base.results.
    """
    if what == EXCEEDED_MEMORY:
        return [
            "the last upload does not fit into memory: it needs %d bytes, %d are free" % (by, room)
        ]
    if what == EXCEEDED_RATE:
        return [
            "the last move was refused: %d frames in 1000 s are more than the %d that are possible"
            % (by, room)
        ]
    if what not in EXCEEDED:
        return []
    return [
        "the last move exceeds, at frame %d of motor %d, " % (frame, motor)
        + EXCEEDED[what].replace("%d", str(by))
    ]


def conditions(bits):
    """Return a line for each of the CONDITION_ bits of MSG_CONDITION."""
    return [CONDITIONS[bit] for bit in sorted(CONDITIONS) if bits & bit]


def faults(log):
    """Return a line for each fault in a FaultLog."""
    return [text + outcome(bit, log.moved) for bit, text in FAULTS if log.fault & bit]


def positions(controller):
    """Return a line for each motor: its position as reported, and how far that can be trusted.

    Adds a line if some position is lost.
    """
    axes = controller.axes
    found = axes.positions
    axes.choose_sample()
    lines = []
    for motor in range(found.count):
        lines.append(
            "motor %d: %d, %s"
            % (motor + 1, axes.reported[motor], trust(found.states[motor], found.reasons[motor]))
        )
    if LOST in list(found.states):  # MicroPython does not look for a number in a bytearray
        lines.append(LIMITS_COUNT)
    return lines


def load(ms, interrupt_us, passes_us, late_us, latest_us, queued_ms):
    """Return lines about how busy the board was. The arguments are the fields of MSG_LOAD."""
    found = ["worst lateness of a tick in motion: %d us, the limit is %d us" % (late_us, latest_us)]
    if queued_ms < UNSTRAINED:
        found.append("shortest queue of a moving motor: %d ms" % queued_ms)
    if 0 < ms < _LONGEST_MS and interrupt_us and passes_us:
        found.append(
            "load of the last %d s: %s ticks, %s passes of the main loop"
            % ((ms + 500) // 1000, _percent(interrupt_us // ms), _percent(passes_us // ms))
        )
    return found


def _percent(thousandths):
    return "%d.%d %%" % (thousandths // 10, thousandths % 10)
