"""The `home` settings of the rig file. Loaded only if a motor has `home`. Allocates."""

from framestep.base.native import const
from framestep.motors.motor import DEFAULT_ACCELERATION, DEFAULT_VELOCITY
from framestep.rig.settings import NO_PIN, RigError, read

# fmt: off
# same columns as the tables of settings.py
HOME_SETTINGS = {
    "limit": (int, 1, 12, None, "",
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
    "order": (int, 0, 12, 0, "",
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
