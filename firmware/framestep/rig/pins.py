"""Pins that a board has for a rig file's settings, and their use. Allocates."""

from framestep.rig.settings import (
    INPUT_SETTINGS,
    LIMIT_SETTINGS,
    NO_PIN,
    OUTPUT_SETTINGS,
    RigError,
    read,
    read_list,
)

# keys of a board's data whose pins are in use with any rig file
_BOARD_PINS = (
    "step", "dir", "enable", "estop", "shutter", "meter", "led", "rgb", "jumper", "button", "flash",
    "uart", "usb",
)  # fmt: skip
# Outputs of a board with a chain of shift registers; the chip's own pins are its inputs
_CHAIN = (64, 93)


def _pins(value):
    """Return the pins in an entry of a board's data: a pin, a list, or a serial line."""
    if isinstance(value, dict):
        return [value["tx"], value["rx"]]
    return value if isinstance(value, list) else [value]


def fitted(board, count=0, drivers=False):
    """Return the board's data for `count` motors (0: all), with or without `drivers` on their
    serial line.

    Entries of `freed` and `with_drivers` apply if no motor in use has their pins.
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
    """Return {pin: its use on this board}."""
    taken = {}
    for key in _BOARD_PINS:
        pins = board.get(key, [])
        for i, pin in enumerate(pins if isinstance(pins, list) else [pins]):
            taken[pin] = "the board's %s" % key + (
                " %d" % (i + 1) if isinstance(pins, list) else ""
            )
    lines = (
        ("dmx", "DMX"),
        ("drivers", "driver UART's"),
        ("chain", "shift registers'"),
        ("registers", "shift registers'"),
    )
    for line, what in lines:
        if line in board and (dmx or line != "dmx"):
            for key in ("tx", "rx", "sck", "ws", "sd", "data", "clock", "latch", "enable"):
                if key in board[line]:
                    taken[board[line][key]] = "the board's %s %s" % (what, key)
    return taken


def assign(settings, board, others=()):
    """Assign pins to limits, outputs and inputs. Each pin can be used once.

    settings: the whole file's. board: the board's data, see fitted(). others: (pin, its key) of
    servos and a pendant. Return (limits, outputs, inputs), each a list of dictionaries. Raises
    RigError for a mistake.
    """
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
        low, high = _CHAIN if "chain" in board and others is switches else (0, highest)
        if not low <= pin <= high:
            raise RigError("%s: found %d, allowed is a pin from %d to %d" % (what, pin, low, high))
        if pin in taken:
            raise RigError(
                "%s: found %d, which is %s already; allowed is a free pin" % (what, pin, taken[pin])
            )
        if pin in others:
            kind = "output" if pin in drives else "input"
            raise RigError(
                "%s: found %d, which is wired as an %s on this board" % (what, pin, kind)
            )
        taken[pin] = what

    for i, pin in enumerate(board.get("drivers", {}).get("pins", [])):
        claim(pin, "motors[%d].driver.pin" % (i + 1), switches + drives)
    for pin, key in others:
        if pin != NO_PIN or board:
            claim(pin, key, drives if "pendant" in key else switches + drives)
    limits = read_list(LIMIT_SETTINGS, settings["limits"], "limits")
    for i, limit in enumerate(limits):
        for key in ("high", "low", "pin"):
            if limit[key] != NO_PIN:
                claim(limit[key], "limits[%d].%s" % (i + 1, key))
        pin = limit["pin"]
        if pin == NO_PIN:
            if "ends" in settings["limits"][i]:
                raise RigError('limits[%d].ends: found "both", but there is no `pin`' % (i + 1))
            if limit["high"] == NO_PIN and limit["low"] == NO_PIN:
                raise RigError(
                    "limits[%d]: found no switch; allowed is `high`, `low` or both, or `pin`"
                    % (i + 1)
                )
        elif limit["high"] != NO_PIN or limit["low"] != NO_PIN:
            raise RigError(
                "limits[%d].pin: found %d, but `high` and `low` are for switches with inputs of "
                "their own; allowed is one or the other" % (i + 1, pin)
            )
        else:
            limit["high"] = limit["low"] = pin
    lists = []
    for key, table in (("outputs", OUTPUT_SETTINGS), ("inputs", INPUT_SETTINGS)):
        lists.append(None if settings[key] is None else read_list(table, settings[key], key))
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
            lists[k] = [read(table, {"pin": pin}, "") for pin in mine if pin not in taken]
    for key in ("go_input", "shoot_input"):
        if settings[key] > len(lists[1]):
            raise RigError(
                "%s: found %d, but there are %d inputs" % (key, settings[key], len(lists[1]))
            )
    used = {}
    for key in ("go_input", "shoot_input", "home_input"):
        if settings[key] in used:
            raise RigError(
                "%s: found %d, which is %s already; allowed is another input"
                % (key, settings[key], used[settings[key]])
            )
        if settings[key]:
            used[settings[key]] = key
    return limits, lists[0], lists[1]
