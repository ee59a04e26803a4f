"""The user's rig file, rig.json: every setting with its type, range, default and meaning in one
table.

A file counts as a whole or not at all. For a mistake the error text has the key, what was found and
what is allowed, and all settings stay at their defaults. Runs once at boot, and on a computer to
check a file. Allocates.
"""

# name: (type, lowest or choices, highest or length, default, unit, meaning)
SETTINGS = {
    "name": (
        str,
        1,
        32,
        "framestep",
        "bytes of UTF-8",
        "what Dragonframe shows as the device's name",
    ),
    "dialect": (
        str,
        ("spec", "dmc-lite"),
        None,
        "spec",
        "",
        "form of the answers: as specified, or as dmc-lite sends",
    ),
    "ports": (
        int,
        1,
        2,
        2,
        "",
        "2: the protocol has a USB port of its own, 1: it shares the one of the REPL",
    ),
    "jog_timeout_ms": (
        int,
        0,
        60000,
        500,
        "ms",
        "a jog ends when no further one comes for so long; 0: never",
    ),
    "hard_stop_factor": (int, 1, 16, 4, "", "a hard stop decelerates so many times as steeply"),
    "go_input": (
        int,
        0,
        16,
        0,
        "",
        "number of the general input that gives GO when it comes on; 0: none",
    ),
    "strict_moves": (
        bool,
        None,
        None,
        False,
        "",
        "refuses moves whose corners ask for more than a motor's acceleration; "
        "without it they are played as uploaded",
    ),
    "report_ms": (int, 20, 1000, 100, "ms", "how often positions are sent while something moves"),
    "motor_count": (
        int,
        0,
        12,
        0,
        "",
        "how many motors; the others' pins are free then. 0: all that the board has",
    ),
    "virtuals": (
        int,
        0,
        124,
        124,
        "",
        "virtual axes, a sum: 4 boom-swing-track, 8 swing-pan, "
        "16 Y-swing-track, 32 X-Y-Z, 64 aim; 0 saves memory",
    ),
    "motors": (list, 0, 12, [], "", "settings of motor 1, 2, …"),
    "outputs": (
        list,
        0,
        16,
        None,
        "",
        "general outputs 1, 2, …; without it those of the board, on its page",
    ),
    "inputs": (
        list,
        0,
        16,
        None,
        "",
        "general inputs 1, 2, …; without it those of the board, on its page",
    ),
    "limits": (list, 0, 12, [], "", "limit switch sets 1, 2, … that SET_LIMITS assigns to motors"),
    "estop": (
        str,
        ("none", "nc", "no"),
        None,
        "none",
        "",
        "stop button between its pin and ground: normally closed, open",
    ),
    "estop_cuts_power": (
        bool,
        None,
        None,
        False,
        "",
        "the stop button also cuts the motors' power: they lose positions",
    ),
    "shutter_on": (
        str,
        ("high", "low"),
        None,
        "high",
        "",
        "level of the shutter output while it is on",
    ),
    "meter_on": (
        str,
        ("high", "low"),
        None,
        "high",
        "",
        "level of the meter output while it is on",
    ),
    "remember_positions": (
        bool,
        None,
        None,
        False,
        "",
        "keeps positions at rest over a power cut (docs/safety.md)",
    ),
    "watchdog": (
        bool,
        None,
        None,
        True,
        "",
        "starts the board again if the firmware hangs while a motor moves",
    ),
    "dmx": (bool, None, None, True, "", "sends DMX; false frees its pins"),
    "dmx_break_us": (int, 92, 1000, 176, "µs", "length of the break before each DMX frame"),
    "dmx_mark_us": (int, 12, 1000, 20, "µs", "length of the mark after break"),
    "dmx_ramp_ms": (
        int,
        0,
        60000,
        500,
        "ms",
        "how long lights take to a level that is to be ramped to",
    ),
}

MOTOR_SETTINGS = {
    "invert": (bool, None, None, False, "", "swaps the direction"),
    "pulse_us": (float, 0.25, 4.0, 1.0, "µs", "how long a step pulse is high"),
    "setup_us": (float, 0.0, 200.0, 5.0, "µs", "from a change of direction to the next step"),
    "enable_high": (
        bool,
        None,
        None,
        False,
        "",
        "the driver is on while its enable pin is high, not low",
    ),
    "backlash": (
        int,
        0,
        10000,
        0,
        "steps",
        "play of the gears, taken up where the motion turns; positions stay those of the load",
    ),
    "jerk": (int, 0, 1000000, 0, "· 1000 steps/s³", "limit of the jerk; 0: none, plain trapezoids"),
    "driver": (
        dict,
        None,
        None,
        None,
        "",
        "how to set up a TMC2209 over its UART; without it the driver is left alone",
    ),
}

DRIVER_SETTINGS = {
    "run_ma": (
        int,
        10,
        2000,
        None,
        "mA",
        "current in motion, root mean square; rounded down to 1/32 of what is possible",
    ),
    "hold_percent": (
        int,
        0,
        100,
        50,
        "%",
        "current at rest, of that in motion; 0: none, the motor turns freely",
    ),
    "hold_delay_ms": (int, 50, 5500, 500, "ms", "from rest to the lower current"),
    "microsteps": (int, (1, 2, 4, 8, 16, 32, 64, 128, 256), None, 16, "", "steps for a full step"),
    "interpolate": (bool, None, None, True, "", "the driver makes 256 microsteps of these"),
    "mode": (
        str,
        ("stealth", "spread"),
        None,
        "stealth",
        "",
        "StealthChop, silent, or SpreadCycle, stronger when fast",
    ),
    "sense_mohm": (int, 50, 1000, 110, "mΩ", "the sense resistors beside the driver"),
    "pin": (
        int,
        -1,
        47,
        -1,
        "",
        "of the driver's UART where each driver has its own; -1: as the board's page has it",
    ),
}

_NO_PIN = -1

OUTPUT_SETTINGS = {
    "pin": (int, 0, 47, None, "", "number of the pin"),
    "on": (str, ("high", "low"), None, "high", "", "level of the pin while the output is on"),
    "safe": (
        str,
        ("off", "on", "hold"),
        None,
        "off",
        "",
        "at a fault, an E-stop or a lost host; at boot hold means off",
    ),
}

INPUT_SETTINGS = {
    "pin": (int, 0, 47, None, "", "number of the pin"),
    "on": (str, ("high", "low"), None, "low", "", "level of the pin while the input is on"),
    "pull": (str, ("up", "down", "none"), None, "up", "", "the resistor in the chip"),
}

LIMIT_SETTINGS = {
    "high": (
        int,
        _NO_PIN,
        47,
        _NO_PIN,
        "",
        "pin of the switch at the upper end, against ground; -1: none",
    ),
    "low": (
        int,
        _NO_PIN,
        47,
        _NO_PIN,
        "",
        "pin of the switch at the lower end, against ground; -1: none",
    ),
    "contact": (
        str,
        ("nc", "no"),
        None,
        "nc",
        "",
        "the switches are closed (nc) or open (no) away from the end",
    ),
}

# keys of a board's data whose pins are in use whatever the rig file says
_BOARD_PINS = ("step", "dir", "enable", "estop", "shutter", "meter", "led", "rgb", "jumper")


class RigError(ValueError):
    """A rig file with a mistake; the text names the key, what was found and what is allowed."""


def _allowed(kind, low, high, unit):
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


def _fits(value, kind, low, high):
    if isinstance(low, tuple):
        return isinstance(value, kind) and not isinstance(value, bool) and value in low
    if kind is dict:
        return isinstance(value, dict)
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
                    % (where, key, _allowed(kind, low, high, unit))
                )
        elif not _fits(value, kind, low, high):
            raise RigError(
                "%s%s: found %r, allowed is %s"
                % (where, key, value, _allowed(kind, low, high, unit))
            )
        result[key] = value
    return result


def _read_list(settings, found, where):
    return [_read(settings, item, "%s[%d]." % (where, i + 1)) for i, item in enumerate(found)]


def _pins(value):
    """The pins in an entry of a board's data, which is a pin, a list, or a serial line."""
    if isinstance(value, dict):
        return [value["tx"], value["rx"]]
    return value if isinstance(value, list) else [value]


def fitted(board, count=0, drivers=False):
    """The board's data for `count` motors (0: all), with or without `drivers` on their serial line.

    Entries of `freed` and `with_drivers` count if no motor in use has their pins.
    """
    board = dict(board)
    freed = board.pop("freed", {})
    changes = [freed, board.pop("with_drivers", {})]
    for key in ("step", "dir", "enable"):
        if count and isinstance(board.get(key), list):
            board[key] = board[key][:count]
    if "step" in board:
        board["motors"] = len(board["step"])
    taken = board.get("step", []) + board.get("dir", [])
    for change in changes[: 2 if drivers else 1]:
        for key in change:
            value = change[key]
            if key == "gio":
                value = [pin for pin in value if pin not in taken]
            if not value or [pin for pin in _pins(value) if pin in taken]:
                board.pop(key, None)
            else:
                board[key] = value
    return board


def _board_pins(board, dmx):
    """{pin: what it is for on this board}."""
    taken = {}
    for key in _BOARD_PINS:
        pins = board.get(key, [])
        for i, pin in enumerate(pins if isinstance(pins, list) else [pins]):
            taken[pin] = "the board's %s" % key + (
                " %d" % (i + 1) if isinstance(pins, list) else ""
            )
    for line, what in (("dmx", "DMX"), ("drivers", "driver UART's")):
        if line in board and (dmx or line != "dmx"):
            for key in ("tx", "rx"):
                if key in board[line]:
                    taken[board[line][key]] = "the board's %s %s" % (what, key)
    return taken


class Rig:
    """The settings in force.

    motor(i) has those of motor i (from 0) as a dictionary. `outputs`, `inputs` and `limits` are
    lists of dictionaries, with the board's pins unless the file has others. `board` is the board's
    data for these settings, see fitted(). `drivers` is None, or a list of the registers of each
    motor's TMC2209, with None for a motor without one.
    """

    def __init__(self, found=None, board=None):
        """found: what the file holds (parsed JSON). board: the board's data. RigError for a
        mistake."""
        settings = _read(SETTINGS, {} if found is None else found, "")
        self.motors = _read_list(MOTOR_SETTINGS, settings["motors"], "motors")
        driven = [motor for motor in self.motors if motor["driver"] is not None]
        self.board = fitted({} if board is None else board, settings["motor_count"], driven)
        self._count_motors(settings, len((board or {}).get("step", ())))
        self.drivers = self._read_drivers() if driven else None
        self._assign_pins(settings, self.board)
        self.settings = settings
        self.name = settings["name"].encode()
        self.dword_acks = 1 if settings["dialect"] == "dmc-lite" else 0
        self.ports = settings["ports"]
        self.jog_timeout_ms = settings["jog_timeout_ms"]
        self.hard_stop_factor = settings["hard_stop_factor"]
        self.report_ms = settings["report_ms"]
        self.go_input = settings["go_input"]
        self.strict_moves = settings["strict_moves"]
        self.estop = settings["estop"]
        self.estop_cuts_power = settings["estop_cuts_power"]
        self.shutter_on = settings["shutter_on"]
        self.meter_on = settings["meter_on"]
        self.remember_positions = settings["remember_positions"]
        self.watchdog = settings["watchdog"]
        self.dmx = settings["dmx"]
        self.dmx_break_us = settings["dmx_break_us"]
        self.dmx_mark_us = settings["dmx_mark_us"]
        self.dmx_ramp_ms = settings["dmx_ramp_ms"]
        self.virtuals = settings["virtuals"] & ~3  # capabilities: bits of HI

    def _count_motors(self, settings, most):
        if most and settings["motor_count"] > most:
            raise RigError(
                "motor_count: found %d, this board has %d motors" % (settings["motor_count"], most)
            )
        count = self.board.get("motors", 0)
        if count and len(self.motors) > count:
            raise RigError(
                "motors: found %d, allowed is a list of at most %d here" % (len(self.motors), count)
            )

    def _read_drivers(self):
        """The registers of each motor's driver (io/tmc2209_setup.py), None for a motor without."""
        from framestep.io import tmc2209_setup

        found = []
        addresses = self.board.get("drivers", {}).get("address", [])
        for i in range(self.board.get("motors", len(self.motors))):
            given = self.motors[i]["driver"] if i < len(self.motors) else None
            where = "motors[%d].driver" % (i + 1)
            if given is None:
                found.append(None)
                continue
            if i >= len(addresses):
                there = "of motors 1 to %d" % len(addresses) if addresses else "of no motor"
                raise RigError(
                    "%s: found an object, but the driver UART of this board is that %s"
                    % (where, there)
                )
            self.motors[i]["driver"] = given = _read(DRIVER_SETTINGS, given, where + ".")
            if given["pin"] != _NO_PIN:
                line = dict(self.board["drivers"])
                if "pins" not in line:
                    raise RigError(
                        "%s.pin: found %d, but the drivers share a UART here"
                        % (where, given["pin"])
                    )
                line["pins"] = line["pins"][:i] + [given["pin"]] + line["pins"][i + 1 :]
                self.board["drivers"] = line
            try:
                found.append(tmc2209_setup.registers(given))
            except ValueError as error:
                raise RigError(
                    "%s.run_ma: found %d, allowed is %s" % (where, given["run_ma"], error)
                )
        return found

    def _assign_pins(self, settings, board):
        """Assign pins to outputs, inputs and limits. Each pin can be used once."""
        taken = _board_pins(board, settings["dmx"])

        highest = board.get("pins", 48) - 1
        if settings["estop"] != "none" and board and "estop" not in board:
            raise RigError(
                'estop: found "%s", but this board has no E-stop pin; allowed is "none"'
                % settings["estop"]
            )

        drives = board.get("outputs", [])  # a transistor's input
        switches = board.get("stops", []) + board.get("inputs", [])

        def claim(pin, what, others=drives):
            if pin > highest:
                raise RigError("%s: found %d, allowed is a pin from 0 to %d" % (what, pin, highest))
            if pin in taken:
                raise RigError(
                    "%s: found %d, which is %s already; allowed is a free pin"
                    % (what, pin, taken[pin])
                )
            if pin in others:
                kind = "output" if pin in drives else "input"
                raise RigError(
                    "%s: found %d, which is wired as an %s on this board" % (what, pin, kind)
                )
            taken[pin] = what

        for i, pin in enumerate(board.get("drivers", {}).get("pins", [])):
            claim(pin, "motors[%d].driver.pin" % (i + 1), switches + drives)
        self.limits = _read_list(LIMIT_SETTINGS, settings["limits"], "limits")
        for i, limit in enumerate(self.limits):
            for key in ("high", "low"):
                if limit[key] != _NO_PIN:
                    claim(limit[key], "limits[%d].%s" % (i + 1, key))
        lists = []
        for key, table in (("outputs", OUTPUT_SETTINGS), ("inputs", INPUT_SETTINGS)):
            lists.append(None if settings[key] is None else _read_list(table, settings[key], key))
            for i, item in enumerate(lists[-1] or []):
                claim(
                    item["pin"],
                    "%s[%d].pin" % (key, i + 1),
                    switches if key == "outputs" else drives,
                )
        pins = board.get("gio", [])
        half = len(pins) // 2
        outputs = drives + pins[:half]
        inputs = pins[half:] + board.get("inputs", [])
        for k, (table, mine) in enumerate(((OUTPUT_SETTINGS, outputs), (INPUT_SETTINGS, inputs))):
            if lists[k] is None:
                lists[k] = [_read(table, {"pin": pin}, "") for pin in mine if pin not in taken]
        self.outputs, self.inputs = lists
        if settings["go_input"] > len(self.inputs):
            raise RigError(
                "go_input: found %d, but there are %d inputs"
                % (settings["go_input"], len(self.inputs))
            )

    def motor(self, i):
        return self.motors[i] if i < len(self.motors) else _read(MOTOR_SETTINGS, {}, "")


def load(path="/rig.json", board=None):
    """Read a rig file. Returns (Rig, None), or (Rig with defaults, text of the mistake)."""
    import json

    try:
        with open(path) as file:
            found = json.load(file)
    except OSError:
        return Rig(board=board), None
    except ValueError as error:
        return Rig(board=board), "%s: not valid JSON (%s)" % (path, error)
    try:
        return Rig(found, board), None
    except RigError as error:
        return Rig(board=board), "%s: %s" % (path, error)
