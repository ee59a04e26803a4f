"""The user's rig file, rig.json: every setting with its type, range, default and meaning in one table.

A file is read whole or not at all: a mistake is told with the key, what was found and what is
allowed, and the defaults stay. Runs once at boot (and on the host, to check a file); allocates.
"""

# name: (type, lowest or choices, highest or length, default, unit, meaning)
SETTINGS = {
    "name": (str, 1, 32, "framestep", "bytes of UTF-8", "what Dragonframe shows as the device's name"),
    "dialect": (str, ("spec", "dmc-lite"), None, "spec", "", "form of the answers: as specified, or as dmc-lite sends"),
    "ports": (int, 1, 2, 2, "", "2: the protocol has a USB port of its own, 1: it shares the one of the REPL"),
    "jog_timeout_ms": (int, 0, 60000, 500, "ms", "a jog ends when no further one comes for so long; 0: never"),
    "hard_stop_factor": (int, 1, 16, 4, "", "a hard stop decelerates so many times as steeply"),
    "report_ms": (int, 20, 1000, 100, "ms", "how often positions are sent while something moves"),
    "motors": (list, 0, 12, [], "", "settings of motor 1, 2, …"),
}

MOTOR_SETTINGS = {
    "invert": (bool, None, None, False, "", "swaps the direction"),
    "pulse_us": (float, 0.25, 4.0, 1.0, "µs", "how long a step pulse is high"),
    "setup_us": (float, 0.0, 200.0, 5.0, "µs", "from a change of direction to the next step"),
    "enable_high": (bool, None, None, False, "", "the driver is on while its enable pin is high, not low"),
    "jerk": (int, 0, 1000000, 0, "1000 steps/s³", "limit of the jerk; 0: none, plain trapezoids"),
}


class RigError(ValueError):
    """A rig file with a mistake; the text names the key, what was found and what is allowed."""


def _allowed(kind, low, high, unit):
    if isinstance(low, tuple):
        return "one of " + ", ".join('"%s"' % choice for choice in low)
    if kind is bool:
        return "true or false"
    if kind is str:
        return "a text of %d to %d %s" % (low, high, unit)
    if kind is list:
        return "a list of at most %d objects" % high
    what = "a whole number" if kind is int else "a number"
    return "%s from %s to %s%s" % (what, low, high, " " + unit if unit else "")


def _fits(value, kind, low, high):
    if isinstance(low, tuple):
        return value in low
    if kind is bool:
        return isinstance(value, bool)
    if kind is str:
        return isinstance(value, str) and low <= len(value.encode()) <= high
    if kind is list:
        return isinstance(value, list) and len(value) <= high
    if isinstance(value, bool) or not isinstance(value, (int, float) if kind is float else int):
        return False
    return low <= value <= high


def _read(settings, found, where):
    if not isinstance(found, dict):
        raise RigError("%s: found %r, allowed is an object {…}" % (where or "rig.json", found))
    result = {}
    for key in found:
        if key not in settings:
            raise RigError("%s%s: no such setting; there are %s" % (where, key, ", ".join(sorted(settings))))
    for key in settings:
        kind, low, high, default, unit, _ = settings[key]
        value = found.get(key, default)
        if not _fits(value, kind, low, high):
            raise RigError("%s%s: found %r, allowed is %s" % (where, key, value, _allowed(kind, low, high, unit)))
        result[key] = value
    return result


class Rig:
    """The settings in force. `motor(i)` gives those of motor i (from 0) as a dictionary."""

    def __init__(self, found=None):
        """From what the file holds (parsed JSON); RigError for a mistake."""
        settings = _read(SETTINGS, {} if found is None else found, "")
        self.motors = [
            _read(MOTOR_SETTINGS, motor, "motors[%d]." % (i + 1)) for i, motor in enumerate(settings["motors"])
        ]
        self.settings = settings
        self.name = settings["name"].encode()
        self.wide = 1 if settings["dialect"] == "dmc-lite" else 0
        self.ports = settings["ports"]
        self.jog_timeout_ms = settings["jog_timeout_ms"]
        self.hard_stop_factor = settings["hard_stop_factor"]
        self.report_ms = settings["report_ms"]

    def motor(self, i):
        return self.motors[i] if i < len(self.motors) else _read(MOTOR_SETTINGS, {}, "")


def load(path="/rig.json"):
    """The rig of a file and the mistake in it, or None: (Rig, None) or (Rig with defaults, text)."""
    import json

    try:
        with open(path) as file:
            found = json.load(file)
    except OSError:
        return Rig(), None
    except ValueError as error:
        return Rig(), "%s: not valid JSON (%s)" % (path, error)
    try:
        return Rig(found), None
    except RigError as error:
        return Rig(), "%s: %s" % (path, error)
