"""Every setting of the rig file, rig.json: type, range, default and meaning, in one table.

Error texts name the key, the value found and what is allowed. The build leaves the meanings out of
a board's image. Allocates.
"""

from framestep.base.native import const
from framestep.rig.drivers import TYPE_SETTINGS

MOST = const(24)  # motors of any board; Rig checks how many its own has

# fmt: off
# name: (type, lowest or choices, highest or length, default, unit, meaning)
SETTINGS = {
    "name": (str, 1, 32, "framestep", "bytes of UTF-8, without control characters",
        "the device's name in Dragonframe"),
    "dialect": (str, ("spec", "dmc-lite"), None, "spec", "",
        "form of the answers: as specified, or as dmc-lite sends"),
    "ports": (int, 1, 2, 2, "",
        "2: the protocol has a USB port of its own, 1: it shares the REPL's"),
    "uart_baud": (int, (115200, 230400, 460800, 921600), None, 115200, "baud",
        "rate of the port on an ESP32's UART; the host has to use the same"),
    "jog_timeout_ms": (int, 0, 60000, 500, "ms",
        "a jog ends if it is not repeated within this time; 0: never"),
    "hard_stop_factor": (int, 1, 16, 4, "", "how many times as steeply a hard stop decelerates"),
    "clock_mhz": (int, (0, 125, 150, 160, 200, 240), None, 0, "MHz",
        "clock of the processor; 0: the board's own, see its page"),
    "go_input": (int, 0, 16, 0, "",
        "number of the general input that gives GO when it goes on; 0: none"),
    "shoot_input": (int, 0, 16, 0, "",
        "number of the general input that shoots the next frame when it goes on "
        "(docs/use/moves.md); 0: none"),
    "home_input": (int, 0, 16, 0, "",
        "number of the general input that homes all motors of unknown position when it goes on; "
        "0: none"),
    "strict_moves": (bool, None, None, False, "",
        "refuses moves that exceed a motor's acceleration at corners; otherwise they are played "
        "as uploaded"),
    "smoothing": (bool, None, None, True, "",
        "smooths out the ripple of runs that comes from rounding to whole steps. At a frame's time "
        "a motor has made its uploaded steps, the last of them up to a step's time earlier than "
        "without smoothing. Costs a Pico with eight motors 4 % of its time at 60 frames/s"),
    "report_ms": (int, 20, 1000, 100, "ms", "how often positions are sent while something moves"),
    "motor_count": (int, 0, MOST, 0, "",
        "how many motors; the other motors' pins become free. 0: all that the board has"),
    "virtuals": (int, 0, 124, 124, "",
        "virtual axes, a sum: 4 boom-swing-track, 8 swing-pan, 16 Y-swing-track, 32 "
        "X-Y-Z, 64 aim; 0 saves memory"),
    "motors": (list, 0, MOST, [], "", "settings of motor 1, 2, …"),
    "outputs": (list, 0, 16, None, "",
        "general outputs 1, 2, …; by default the board's, see its page"),
    "inputs": (list, 0, 16, None, "",
        "general inputs 1, 2, …; by default the board's, see its page"),
    "limits": (list, 0, 16, [], "",
        "limit switch sets 1, 2, …; a set stops a motor only once the host has assigned it "
        "(SET_LIMITS)"),
    "pendant": (dict, None, None, None, "",
        "a hand wheel with buttons at the board (docs/use/pendant.md)"),
    "estop": (str, ("none", "nc", "no"), None, "none", "",
        "E-stop button between its pin and ground: normally closed or open"),
    "estop_cuts_power": (bool, None, None, False, "",
        "the E-stop button also cuts the motors' power at once: motors in motion lose their "
        "positions"),
    "shutter_on": (str, ("high", "low"), None, "high", "",
        "level of the shutter output while it is on"),
    "shutter_delay_ms": (int, 0, 5000, 0, "ms",
        "how long the camera takes from the shutter output to the exposure: the output goes on "
        "that much earlier, in runs with stills and in go-motion"),
    "shutter_hold_ms": (int, 0, 5000, 0, "ms",
        "how long the shutter output stays on after the exposure, in the same"),
    "meter_on": (str, ("high", "low"), None, "high", "",
        "level of the meter output while it is on"),
    "remember_positions": (bool, None, None, False, "",
        "keeps positions at rest over a power cut (docs/use/safety.md)"),
    "watchdog": (bool, None, None, True, "",
        "restarts the board if the firmware hangs while a motor moves"),
    "dmx": (bool, None, None, True, "", "sends DMX; false frees its pins"),
    "dmx_break_us": (int, 92, 1000, 176, "µs", "length of the break before each DMX frame"),
    "dmx_mark_us": (int, 12, 1000, 20, "µs", "length of the mark after break"),
    "dmx_ramp_ms": (int, 0, 60000, 500, "ms",
        "how long lights take to ramp to a level"),
}

MOTOR_SETTINGS = {
    "type": (str, ("other",) + tuple(TYPE_SETTINGS), None, "other", "",
        "the driver. Where `pulse_us`, `setup_us`, `hold_us`, `enable_ms` and `enable_high` are "
        "not given, they are what it needs (docs/use/drivers.md#types)"),
    "invert": (bool, None, None, False, "", "swaps the direction"),
    "pulse_us": (float, 0.25, 50.0, 1.0, "µs",
        "how long a step pulse is high, and then low, at least; with `both_edges` from one edge to "
        "the next"),
    "setup_us": (float, 0.0, 200.0, 5.0, "µs",
        "from a change of direction to the next step, at least"),
    "hold_us": (float, 0.0, 50.0, 0.0, "µs",
        "from the end of a step pulse to a change of direction, at least"),
    "enable_high": (bool, None, None, False, "",
        "the driver is on while its enable pin is high, not low"),
    "enable_ms": (int, 0, 2000, 0, "ms",
        "from the switching on of the driver to the first step, at least"),
    "off_after_s": (int, 0, 36000, 0, "s",
        "the driver is switched off when the motor has been at rest for so long, and its position "
        "is then held, not known; drivers that share an enable pin: when all have; 0: never"),
    "backlash": (int, 0, 10000, 0, "steps",
        "steps that the motor makes after a change of direction before the load moves; framestep "
        "adds them at each turn, and they do not count in positions"),
    "jerk": (int, 0, 1000000, 0, "· 1000 steps/s³", "limit of the jerk; 0: none, plain trapezoids"),
    "driver": (dict, None, None, None, "",
        "how to set up a TMC2209 over its UART; by default the driver is left alone"),
    "home": (dict, None, None, None, "",
        "how to home the motor (docs/use/homing.md); by default it cannot be homed"),
    "servo": (dict, None, None, None, "",
        "a hobby servo in the place of a stepper motor (docs/use/servos.md)"),
}

DRIVER_SETTINGS = {
    "run_ma": (int, 10, 2000, None, "mA",
        "current in motion, root mean square; the driver has 32 values, the next lower one is set "
        "(docs/use/drivers.md)"),
    "hold_percent": (int, 0, 100, 50, "%",
        "current at rest, as part of the current in motion; 0: none, the motor turns freely (in "
        "StealthChop only)"),
    "hold_delay_ms": (int, 50, 5500, 500, "ms", "from rest to the lower current"),
    "microsteps": (int, (1, 2, 4, 8, 16, 32, 64, 128, 256), None, 16, "", "steps for a full step"),
    "interpolate": (bool, None, None, True, "", "the driver turns them into 256 microsteps"),
    "mode": (str, ("stealth", "spread"), None, "stealth", "",
        "StealthChop, silent, or SpreadCycle, stronger when fast"),
    "both_edges": (bool, None, None, False, "",
        "a step is one edge at the step input, rising or falling, not a pulse "
        "(docs/use/drivers.md#steps-on-both-edges)"),
    "sense_mohm": (int, 50, 1000, 110, "mΩ", "the sense resistors next to the driver"),
    "pin": (int, -1, 47, -1, "",
        "pin of the driver's UART if each driver has its own; -1: as on the board's page"),
}

NO_PIN = -1

OUTPUT_SETTINGS = {
    "pin": (int, 0, 93, None, "", "number of the pin; an ESP32's shift registers: 64 and up"),
    "on": (str, ("high", "low"), None, "high", "", "level of the pin while the output is on"),
    "safe": (str, ("off", "on", "hold"), None, "off", "",
        "at a fault, an E-stop or a lost host; at boot hold means off"),
}

INPUT_SETTINGS = {
    "pin": (int, 0, 47, None, "", "number of the pin"),
    "on": (str, ("high", "low"), None, "low", "", "level of the pin while the input is on"),
    "pull": (str, ("up", "down", "none"), None, "up", "", "the resistor in the chip"),
}

LIMIT_SETTINGS = {
    "high": (int, NO_PIN, 47, NO_PIN, "",
        "pin of the switch at the upper end, against ground; -1: none"),
    "low": (int, NO_PIN, 47, NO_PIN, "",
        "pin of the switch at the lower end, against ground; -1: none"),
    "pin": (int, NO_PIN, 47, NO_PIN, "",
        "instead of `high` and `low`: pin of the switches at both ends, wired to one input; -1: "
        "none"),
    "ends": (str, ("both",), None, "both", "",
        "what the switches at `pin` are for: both ends (docs/use/homing.md)"),
    "contact": (str, ("nc", "no"), None, "nc", "",
        "the switches are closed (nc) or open (no) away from the end"),
}
# fmt: on


class RigError(ValueError):
    """A mistake in a rig file. The text names the key, what was found and what is allowed."""


def allowed(kind, low, high, unit):
    """Return what a setting may be, as text. The arguments are the columns of its table."""
    if isinstance(low, tuple):
        return "one of " + ", ".join(
            '"%s"' % choice if kind is str else str(choice) for choice in low
        )
    if kind is bool:
        return "true or false"
    if kind is str:
        return "a text of %d to %d %s" % (low, high, unit)
    if kind is list:
        return "a list of at most %d objects" % high
    if kind is dict:
        return "an object {…}"
    what = "a whole number" if kind is int else "a number"
    return "%s from %s to %s%s" % (what, low, high, " " + unit if unit else "")


def fits(value, kind, low, high):
    """Return whether a setting may have a value."""
    if isinstance(low, tuple):
        return isinstance(value, kind) and not isinstance(value, bool) and value in low
    if kind is dict:
        return isinstance(value, dict)
    if kind is bool:
        return isinstance(value, bool)
    if kind is str:
        # a board's JSON does not join a pair of surrogates
        return (
            isinstance(value, str)
            and all(ord(c) >= 0x20 and not 0xD800 <= ord(c) < 0xE000 for c in value)
            and low <= len(value.encode()) <= high
        )
    if kind is list:
        return isinstance(value, list) and len(value) <= high
    if isinstance(value, bool) or not isinstance(value, (int, float) if kind is float else int):
        return False
    return low <= value <= high


def read(settings, found, where):
    """Return the settings of one object of the file, as a dictionary with all keys of a table.

    settings: the table. found: the object in the file. where: its path, for error texts, with a dot
    at its end. Raises RigError for a mistake.
    """
    if not isinstance(found, dict):
        raise RigError(
            "%s: found %r, allowed is an object {…}" % (where.rstrip(".") or "rig.json", found)
        )
    result = {}
    for key in found:
        if key not in settings:
            raise RigError(
                "%s%s: no such setting; there are %s" % (where, key, ", ".join(sorted(settings)))
            )
    for key in settings:
        kind, low, high, default, unit, _ = settings[key]
        value = found.get(key, default)
        if value is None and key not in found:
            if kind is not list and kind is not dict:
                raise RigError(
                    "%s%s: is missing, expected is %s"
                    % (where, key, allowed(kind, low, high, unit))
                )
        elif not fits(value, kind, low, high):
            raise RigError(
                "%s%s: found %r, allowed is %s"
                % (where, key, value, allowed(kind, low, high, unit))
            )
        result[key] = value
    return result


def read_list(settings, found, where):
    """Return a list with the settings of each object of a list; like read()."""
    return [read(settings, item, "%s[%d]." % (where, i + 1)) for i, item in enumerate(found)]
