"""Settings of a pendant. Loaded only if the rig file has one. Allocates."""

from framestep.rig.settings import MOST, NO_PIN, RigError, read

# fmt: off
# same columns as the tables of settings.py
PENDANT_SETTINGS = {
    "a": (int, 0, 47, None, "", "pin of the wheel's output A"),
    "b": (int, 0, 47, None, "", "pin of the wheel's output B"),
    "enable": (int, 0, 47, None, "",
        "pin of the button that has to be held while the wheel is turned, to ground"),
    "axis": (int, NO_PIN, 47, NO_PIN, "",
        "pin of the button that goes on to the next motor, to ground; -1: none, it is motor 1"),
    "step": (int, NO_PIN, 47, NO_PIN, "",
        "pin of the button that goes on from x1 to x10, x100 and back to x1, to ground; -1: none"),
    "motors": (int, 1, MOST, MOST, "",
        "how many motors, from motor 1 on, the axis button goes through"),
    "click": (int, 1, 10000, 1, "steps", "steps of a click of the wheel at x1"),
    "pull": (str, ("up", "none"), None, "up", "", "the resistors in the chip at A and B"),
}
# fmt: on


def read_pendant(found, board):
    """Return the settings of a pendant with all keys. board: the board's data. Raises RigError for
    a mistake."""
    if "chain" in board:
        raise RigError(
            "pendant: found an object, but this chip is too slow to count the edges of a wheel; "
            "allowed is a board with an RP2040 or RP2350"
        )
    return read(PENDANT_SETTINGS, found, "pendant.")


def pins(pendant):
    """Return a list of (pin, key) that a pendant takes."""
    keys = ("a", "b", "enable", "axis", "step")
    return [(pendant[key], "pendant." + key) for key in keys if pendant[key] != NO_PIN]
