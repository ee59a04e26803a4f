"""Settings of motors that are servos, and the rules for them.

Loaded only if the rig file has a servo. Allocates.
"""

from framestep.rig.settings import NO_PIN, RigError, read

_RATES = 4  # timers that an ESP32-S3 has for pulses

# fmt: off
SERVO_SETTINGS = {
    "pin": (int, -1, 48, -1, "",
        "pin of the servo's signal; -1: the motor's step pin, where it is the chip's own"),
    "low_us": (float, 500.0, 2500.0, 1000.0, "µs", "the shortest pulse, at the position `low`"),
    "high_us": (float, 500.0, 2500.0, 2000.0, "µs", "the longest pulse, at the position `high`"),
    "low": (int, -30000, 0, -1000, "steps", "the lowest position; 0 must be within the range"),
    "high": (int, 0, 30000, 1000, "steps", "the highest position"),
    "rate_hz": (int, 40, 333, 50, "Hz",
        "how often a pulse comes; its period is rounded down to whole milliseconds"),
    "at_start": (str, ("off", "on"), None, "off", "",
        "pulses from power-up on; off: once the motor has to move, or the host enables it"),
    "on_stop": (str, ("hold", "release"), None, "hold", "",
        "at the E-stop or a fault: hold the position, or end the pulses at once"),
}
# fmt: on


def read_servos(rig):
    """Read the motors that are servos. Return a list of (motor from 0, pin).

    In the board's data their step and direction pins become NO_PIN, as they are free then.
    """
    found = []
    for i, motor in enumerate(rig.motors):
        if motor["servo"] is None:
            continue
        where = "motors[%d].servo" % (i + 1)
        for key in ("driver", "home"):
            if motor[key] is not None:
                raise RigError("%s: found an object, but the motor has `%s`" % (where, key))
        for key in ("enable_ms", "off_after_s"):  # of a driver's enable pin
            if motor[key]:
                raise RigError(
                    "motors[%d].%s: found %d, allowed is 0, as the motor is a servo"
                    % (i + 1, key, motor[key])
                )
        motor["servo"] = servo = read(SERVO_SETTINGS, motor["servo"], where + ".")
        if servo["high_us"] - servo["low_us"] < 100:
            raise RigError(
                "%s.high_us: found %s, allowed is 100 µs more than low_us at least"
                % (where, servo["high_us"])
            )
        if servo["high"] - servo["low"] < 100 + motor["backlash"]:
            raise RigError(
                "%s.high: found %d, allowed is %d steps more than `low` at least"
                % (where, servo["high"], 100 + motor["backlash"])
            )
        if servo["low"] + motor["backlash"] > 0:
            raise RigError(
                "%s.low: found %d, allowed is %d at most, for the backlash"
                % (where, servo["low"], -motor["backlash"])
            )
        pin = servo["pin"]
        if "chain" in rig.board:
            if pin == NO_PIN:
                raise RigError("%s.pin: found -1, expected is a pin of the chip" % where)
        elif "step" in rig.board:
            if not found:
                for key in ("step", "dir"):
                    rig.board[key] = list(rig.board[key])
            if pin == NO_PIN:
                pin = rig.board["step"][i]
            rig.board["step"][i] = rig.board["dir"][i] = NO_PIN
        found.append((i, pin))
    rates = len({rig.motors[i]["servo"]["rate_hz"] for i, _ in found})
    if "chain" in rig.board and rates > _RATES:
        raise RigError("rate_hz: found %d different ones, allowed are %d here" % (rates, _RATES))
    return found
