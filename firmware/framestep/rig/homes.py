"""The `home` settings of the rig file. Loaded only if a motor has `home`. Allocates."""

from framestep.base.native import const
from framestep.motors.rates import DEFAULT_ACCELERATION, DEFAULT_VELOCITY
from framestep.rig.settings import MOST, NO_PIN, RigError, read

# fmt: off
# same columns as the tables of settings.py
HOME_SETTINGS = {
    "limit": (int, 1, 16, None, "",
        "number of the limit switch set (in `limits`) that contains the home switch"),
    "toward": (str, ("low", "high"), None, "low", "",
        "the end with the switch: toward lower or toward higher positions"),
    "position": (int, -1000000000, 1000000000, 0, "steps",
        "the motor's position where the switch is found"),
    "speed": (int, 10, 500000, 1000, "steps/s",
        "velocity toward the switch and off it; never more than the motor's setting"),
    "slow_speed": (int, 10, 500000, 100, "steps/s", "toward it for the second time"),
    "back_off": (int, 1, 1000000, 200, "steps",
        "distance from the switch back to where it is surely open"),
    "travel": (int, 1, 100000000, None, "steps",
        "longest distance of the search: a little more than the length of the axis"),
    "stall": (int, 0, 255, 0, "",
        "StallGuard threshold of the motor's TMC2209, whose DIAG is the switch; 0: a real switch"),
    "square_within": (int, 0, 100000, 0, "steps",
        "this motor and the next one are the two sides of a gantry, each with a home switch: how "
        "many steps one may need more than the other to its switch; 0: they are not"),
    "square": (int, -100000, 100000, 0, "steps",
        "how much farther the next motor goes from its switch than this one, so that the gantry is "
        "square"),
    "order": (int, 0, MOST, 0, "",
        "motors with lower numbers are homed first"),
}
# fmt: on


_SEEN_MS = const(2)  # longest time from the switch to the tick that slows the motor down


def read_homes(motors, limits, drivers, hard_stop_factor):
    """Read each motor's `home`. Return Rig.drivers, with StallGuard set up for motors that use it.

    motors: dictionaries of MOTOR_SETTINGS; each `home` is replaced by one with all keys. limits:
    Rig.limits. drivers: Rig.drivers, or None. Raises RigError for a mistake.
    """
    for i, motor in enumerate(motors):
        if motor["home"] is not None:
            where = "motors[%d].home." % (i + 1)
            motor["home"] = home = _read(motor["home"], where, limits, hard_stop_factor)
            _check_square(motors, i, limits, hard_stop_factor)
            driver = motor["driver"]
            if not home["stall"]:
                continue
            if driver is None or driver["mode"] != "stealth":
                raise RigError(
                    '%sstall: found %d, allowed is 0 without a `driver` in mode "stealth"'
                    % (where, home["stall"])
                )
            from framestep.io.tmc2209_setup import with_stall

            table = with_stall(drivers[i], home["stall"], home["speed"], driver["microsteps"])
            drivers = drivers[:i] + [table] + drivers[i + 1 :]
    return drivers


def _check_square(motors, i, limits, hard_stop_factor):
    """Check the `home` of the first side of a gantry, motors[i], against that of the next motor.
    Called for each motor with a `home`; the next one's has not been read yet."""
    home = motors[i]["home"]
    where = "motors[%d].home." % (i + 1)
    if not home["square_within"]:
        if home["square"]:
            raise RigError("%ssquare: found %d, but square_within is 0" % (where, home["square"]))
        return
    if i + 1 >= len(motors) or motors[i + 1]["home"] is None:
        raise RigError(
            "%ssquare_within: found %d, but motors[%d] has no `home`"
            % (where, home["square_within"], i + 2)
        )
    other = _read(motors[i + 1]["home"], "motors[%d].home." % (i + 2), limits, hard_stop_factor)
    if other["square_within"]:
        raise RigError(
            "motors[%d].home.square_within: found %d, but it is the other side of motors[%d]"
            % (i + 2, other["square_within"], i + 1)
        )
    pins = [limits[each["limit"] - 1][each["toward"]] for each in (home, other)]
    for each in (home, other):
        if limits[each["limit"] - 1]["pin"] != NO_PIN or pins[0] == pins[1]:
            raise RigError(
                "%ssquare_within: found %d, but the two sides do not have a home switch with an "
                "input of its own each" % (where, home["square_within"])
            )
    least = least_back_off(home["speed"], hard_stop_factor) - other["back_off"]
    if home["square"] < least:
        raise RigError(
            "%ssquare: found %d, allowed is %d at least: else the next motor stays on its switch"
            % (where, home["square"], least)
        )


def _read(found, where, limits, hard_stop_factor):
    home = read(HOME_SETTINGS, found, where)
    number = home["limit"]
    if number > len(limits):
        raise RigError(
            "%slimit: found %d, but there are %d limit switch sets" % (where, number, len(limits))
        )
    if limits[number - 1][home["toward"]] == NO_PIN:
        raise RigError(
            "%slimit: found %d, but limits[%d].%s has no pin"
            % (where, number, number, home["toward"])
        )
    for key, most in (("slow_speed", "speed"), ("back_off", "travel")):
        if home[key] > home[most]:
            raise RigError(
                "%s%s: found %d, allowed is at most the %s, %d"
                % (where, key, home[key], most, home[most])
            )
    least = least_back_off(home["speed"], hard_stop_factor)
    if home["back_off"] < least:
        raise RigError(
            "%sback_off: found %d, allowed is %d at least: at its speed the motor runs on that far"
            % (where, home["back_off"], least)
        )
    return home


def least_back_off(speed, hard_stop_factor):
    """Return the least `back_off`: more steps than a motor runs on behind its switch at the
    velocity and acceleration of power-up. The switch's position is known to within these."""
    speed = min(speed, DEFAULT_VELOCITY)
    run_on = speed * speed // (2 * DEFAULT_ACCELERATION * hard_stop_factor)
    return run_on + speed * _SEEN_MS // 1000 + 1
