"""The user's rig file, rig.json, and the settings in force.

A file with a mistake is ignored as a whole: all settings then stay at their defaults. This runs
once at boot, and on a computer to check a file. Allocates.
"""

from framestep.rig.drivers import complete
from framestep.rig.pins import assign, fitted
from framestep.rig.settings import (
    DRIVER_SETTINGS,
    MOTOR_SETTINGS,
    NO_PIN,
    SETTINGS,
    RigError,
    read,
    read_list,
)


class Rig:
    """The settings in force.

    motor(i) returns the settings of motor i (from 0) as a dictionary. `outputs`, `inputs` and
    `limits` are lists of dictionaries; without an entry in the file they have the board's pins.
    `board` is the board's data for these settings, see fitted(). `drivers` is None, or a list of
    each motor's TMC2209 registers, with None for a motor without a driver.
    """

    def __init__(self, found=None, board=None):
        """found: the file's content (parsed JSON). board: the board's data. Raises RigError for a
        mistake."""
        settings = read(SETTINGS, {} if found is None else found, "")
        self.motors = read_list(MOTOR_SETTINGS, settings["motors"], "motors")
        for i, motor in enumerate(self.motors):
            complete(motor, settings["motors"][i])
            if motor["driver"] is not None and motor["type"] not in ("other", "tmc2209"):
                raise RigError(
                    'motors[%d].type: found "%s", but `driver` sets up a TMC2209'
                    % (i + 1, motor["type"])
                )
            if motor["servo"] is not None and motor["type"] != "other":
                raise RigError(
                    'motors[%d].type: found "%s", but the motor is a servo' % (i + 1, motor["type"])
                )
        driven = [motor for motor in self.motors if motor["driver"] is not None]
        self.board = fitted({} if board is None else board, settings["motor_count"], driven)
        self._check_pins({} if found is None else found, settings)
        self._count_motors(settings, len((board or {}).get("step", ())))
        servos = self._read_servos()
        self.drivers = self._read_drivers() if driven else None
        self.pendant = None
        others = [(pin, "motors[%d].servo.pin" % (i + 1)) for i, pin in servos]
        if settings["pendant"] is not None:
            from framestep.rig import pendants

            self.pendant = pendants.read_pendant(settings["pendant"], self.board)
            others += pendants.pins(self.pendant)
        self.limits, self.outputs, self.inputs = assign(settings, self.board, others)
        self.servos = 0  # one bit for each motor that is a servo
        for i, pin in servos:
            self.servos |= 1 << i
            if "step" in self.board and "chain" not in self.board:
                self.board["step"][i] = self.board["dir"][i] = pin
        self._set_clock(settings["clock_mhz"])
        self.home_input = settings["home_input"]
        self.settings = settings
        self.homing = self._read_homes()  # whether any motor can be homed
        self.name = settings["name"].encode()
        self.dword_acks = 1 if settings["dialect"] == "dmc-lite" else 0
        self.ports = self._read_ports(found, settings["ports"])
        self.jog_timeout_ms = settings["jog_timeout_ms"]
        self.hard_stop_factor = settings["hard_stop_factor"]
        self.report_ms = settings["report_ms"]
        self.go_input = settings["go_input"]
        self.shoot_input = settings["shoot_input"]
        self.strict_moves = settings["strict_moves"]
        self.smoothing = settings["smoothing"]
        self.estop = settings["estop"]
        self.estop_cuts_power = settings["estop_cuts_power"]
        self.shutter_on = settings["shutter_on"]
        self.meter_on = settings["meter_on"]
        self.shutter_delay_ms = settings["shutter_delay_ms"]
        self.shutter_hold_ms = settings["shutter_hold_ms"]
        self.remember_positions = settings["remember_positions"]
        self.watchdog = settings["watchdog"]
        self.dmx = settings["dmx"]
        self.dmx_break_us = settings["dmx_break_us"]
        self.dmx_mark_us = settings["dmx_mark_us"]
        self.dmx_ramp_ms = settings["dmx_ramp_ms"]
        self.virtuals = settings["virtuals"]  # capabilities: bits of HI
        if self.virtuals & 3:
            raise RigError(
                "virtuals: found %d, allowed is a sum of 4, 8, 16, 32 and 64" % self.virtuals
            )

    def _check_pins(self, found, settings):
        """Raise RigError for a setting of a pin that this board does not have or use."""
        for key in found:
            pin = key.split("_")[0]
            unused = False if key == "dmx" else SETTINGS[key][3]
            if pin in ("dmx", "shutter", "meter") and self.board and pin not in self.board:
                if found[key] != unused:
                    value = "true" if key == "dmx" else repr(found[key])
                    raise RigError("%s: found %s, but this board has no pin for it" % (key, value))
        if settings["estop_cuts_power"] and settings["estop"] == "none":
            raise RigError('estop_cuts_power: found true, but `estop` is "none"')

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

    def _read_ports(self, found, ports):
        """Return the number of ports. A board that has only one needs no setting for it."""
        most = self.board.pop("ports", 2)
        if ports > most and "ports" in (found or {}):
            raise RigError("ports: found %d, this board has %d" % (ports, most))
        ports = min(ports, most)
        if "uart_baud" in (found or {}) and self.board and (ports == 2 or "uart" not in self.board):
            raise RigError("uart_baud: found %d, but this board's port is USB" % found["uart_baud"])
        return ports

    def _set_clock(self, mhz):
        """Set the board's clock_mhz; 0 keeps its own."""
        clocks = self.board.pop("clocks", [0])
        if mhz and mhz not in clocks:
            there = "".join([", %d" % clock for clock in clocks if clock])
            raise RigError("clock_mhz: found %d, allowed is one of 0%s here" % (mhz, there))
        if mhz:
            self.board["clock_mhz"] = mhz

    def _read_servos(self):
        """Return a list of (motor from 0, pin) of the motors that are servos."""
        with_servo = [i for i, motor in enumerate(self.motors) if motor["servo"] is not None]
        if not with_servo:
            return []
        if "registers" in self.board:
            raise RigError(
                "motors[%d].servo: found an object, but shift registers make only steps"
                % (with_servo[0] + 1)
            )
        from framestep.rig import servos

        return servos.read_servos(self)

    def _read_drivers(self):
        """Return each motor's driver registers (io/tmc2209_setup.py), None without a driver."""
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
            self.motors[i]["driver"] = given = read(DRIVER_SETTINGS, given, where + ".")
            if given["both_edges"] and ("chain" in self.board or "registers" in self.board):
                raise RigError(
                    "%s.both_edges: found true, allowed is false: this board makes only pulses"
                    % where
                )
            if given["mode"] == "spread" and given["hold_percent"] == 0:
                raise RigError(
                    '%s.hold_percent: found 0, allowed is 1 to 100 in mode "spread": only in '
                    "StealthChop does a motor without current turn freely" % where
                )
            if given["pin"] != NO_PIN:
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

    def _read_homes(self):
        """Read how motors are homed. Return whether any motor can be."""
        if [motor for motor in self.motors if motor["home"] is not None]:
            from framestep.rig.homes import read_homes

            factor = self.settings["hard_stop_factor"]
            self.drivers = read_homes(self.motors, self.limits, self.drivers, factor)
            found = True
        else:
            found = False
        if self.home_input > len(self.inputs):
            raise RigError(
                "home_input: found %d, but there are %d inputs"
                % (self.home_input, len(self.inputs))
            )
        if self.home_input and not found:
            raise RigError("home_input: found %d, but no motor has `home`" % self.home_input)
        return found

    def motor(self, i):
        """Return the settings of motor i (from 0), or the defaults. Allocates."""
        return self.motors[i] if i < len(self.motors) else read(MOTOR_SETTINGS, {}, "")


def load(path="/rig.json", board=None):
    """Read a rig file. Return (Rig, None), or (Rig with defaults, text of the mistake)."""
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
