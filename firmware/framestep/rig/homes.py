"""How the rig file says that motors are homed. Loaded to read it, where a motor has `home`;
allocates."""

from framestep.base.native import const
from framestep.motors.motor import DEFAULT_ACCELERATION, DEFAULT_VELOCITY
from framestep.rig.settings import NO_PIN, RigError, read

# fmt: off
# as the tables of settings.py
HOME_SETTINGS = {
    "limit": (int, 1, 12, None, "",
        "the limit switch set (of `limits`) that has the home switch"),
    "toward": (str, ("low", "high"), None, "low", "",
        "the end at which it is: where positions become lower or higher"),
    "position": (int, -1000000000, 1000000000, 0, "steps",
        "the motor's position where the switch is found"),
    "speed": (int, 10, 500000, 1000, "steps/s",
        "toward the switch and off it; never more than the motor is set to"),
    "slow_speed": (int, 10, 500000, 100, "steps/s", "toward it for the second time"),
    "back_off": (int, 1, 1000000, 200, "steps",
        "from the switch back to where it is open for sure"),
    "travel": (int, 1, 100000000, None, "steps",
        "how far to look for it at most: a little more than the whole way of the axis"),
    "stall": (int, 0, 255, 0, "",
        "StallGuard threshold of the motor's TMC2209, whose DIAG is the switch; 0: a real switch"),
    "order": (int, 0, 12, 0, "",
        "where several motors are homed, those with lower numbers come first"),
}
# fmt: on


_SEEN_MS = const(2)  # from the switch to the tick that slows the motor down, at the latest


def read_homes(motors, limits, drivers, hard_stop_factor):
    """Read each motor's `home`. Returns Rig.drivers, with StallGuard set up where it is wanted.

    motors: dictionaries of MOTOR_SETTINGS, in which `home` is put anew with all its keys. limits:
    Rig.limits. drivers: Rig.drivers, or None. RigError for a mistake.
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
    """More steps than a motor runs on behind its switch, at the velocity and acceleration that it
    has at power-up: where the switch was found is known to within these."""
    speed = min(speed, DEFAULT_VELOCITY)
    run_on = speed * speed // (2 * DEFAULT_ACCELERATION * hard_stop_factor)
    return run_on + speed * _SEEN_MS // 1000 + 1
