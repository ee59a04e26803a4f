"""How everything is stopped when something goes wrong, and the host's STOP_ALL.

ARCHITECTURE.md has a table of all that stops motors. Nothing here allocates.
"""

from framestep.base.clock import elapsed
from framestep.base.native import const
from framestep.motors.positions import DRIVER, STEPS
from framestep.protocol import messages as m
from framestep.pulse import stepper

# Bits of `fault`, above the kernel's FAULT_ bits; their texts are in texts.py
FAULT_LOST = const(0x10)
FAULT_ESTOP = const(0x20)
FAULT_LIMIT = const(0x40)
FAULT_DRIVER = const(0x80)
FAULT_TAKEN = const(0x100)
FAULT_HOMING = const(0x400)  # what the REPL is told about it comes from homing.py

TOLD_HOMING = const(0x400)  # of `unreported`: homing has something to tell

SECOND_STOP_MS = const(1000)  # field note 4.4


class Stops:
    """Stops motors and outputs, and keeps the reason.

    controller: for what is stopped. `fault` is why the motors were stopped (FAULT_ bits), until a
    motor is sent somewhere again; `unreported` is the same until the REPL has been told.
    """

    def __init__(self, controller):
        self.controller = controller
        self.fault = 0
        self.unreported = 0
        self.stop_all_at = -1  # when the last STOP_ALL came, ms

    def allow_motion(self):
        """Whether any motor may be moved."""
        controller = self.controller
        return not controller.broken and not controller.safety.tripped and self.check_pins()

    def stop_everything(self):
        """Ramp all motors down and set all outputs to their safe levels."""
        controller = self.controller
        controller.io.safe()
        controller.operations.stop()
        controller.run_outputs.abort()
        controller.virtuals.halt()
        controller.axes.stop()
        controller.motors.switch_off(controller.axes.released)

    def crash_stop(self):
        """After an exception in a pass: stop_everything(), and tell the host at once (note 8.4)."""
        self.stop_everything()
        controller = self.controller
        writer = controller.writer
        writer.begin(m.MSG_MOTOR_HARD_STOP, None)
        writer.u8(m.HARD_STOP_FAULT)
        writer.end()
        controller.port.send(writer)

    def fault_stop(self):
        """After an internal fault: stop_everything(), and tell the host soon (field note 8.4)."""
        self.stop_everything()
        controller = self.controller
        controller.motors.jogging = 0
        self.end_homing()
        controller.reports.hard_stop = m.HARD_STOP_FAULT

    def _note_fault(self, fault):
        """Note why the motors are stopped. fault: FAULT_ bits."""
        self.fault |= fault
        self.unreported |= fault

    def on_host_lost(self):
        """The host has closed the port or does not read: all ramp down (field note 1.11)."""
        controller = self.controller
        virtuals = controller.virtuals
        ready = controller.hal.ready()
        controller.operations.host_lost(ready, virtuals.engaged)
        if ready:
            virtuals.stop()
            controller.axes.stop(1, virtuals.engaged, True)
        else:
            virtuals.halt()  # no motor may turn round on the way to rest
            controller.axes.stop()
        controller.io.safe()
        controller.run_outputs.abort()
        controller.motors.jogging = 0
        self.end_homing()
        controller.reports.nobody_listens()

    def on_stop_input(self):
        """A stop input has become active: hard-stop what it is for (field note 8.4)."""
        controller = self.controller
        axes = controller.axes
        virtuals = controller.virtuals
        operations = controller.operations
        factor = controller.rig.hard_stop_factor
        if controller.safety.tripped:
            if controller.rig.estop_cuts_power:
                controller.positions.power_cut(axes.moving_bits())
            self._note_fault(FAULT_ESTOP)
            controller.motors.jogging = 0
            self.end_homing()
            operations.stop(factor)
            virtuals.halt(factor)
            axes.stop(factor)
            controller.motors.switch_off(controller.axes.released)
            controller.io.safe()
            controller.run_outputs.abort()
            return
        bits = controller.safety.motors_at_limit()
        if controller.motors.homing:
            bits = controller.homing.take_limit(bits)
        if bits:
            self._note_fault(FAULT_LIMIT)
        controller.motors.jogging &= ~bits
        if virtuals.engaged & bits:
            virtuals.halt()
        for motor in range(controller.count):
            if (bits >> motor) & 1:
                if operations.takes(motor):
                    operations.stop(spared=virtuals.engaged)
                axes[motor].stop(controller.hal, factor)

    def end_homing(self, bits=-1):
        """Homing is over if any of these motors is homed: they are about to be stopped."""
        controller = self.controller
        if controller.motors.homing & bits:
            controller.motors.homing = 0
            controller.homing.release()

    def on_fault(self, lost):
        """The kernel has found a fault, or the engine has lost commands of the motors `lost`."""
        controller = self.controller
        header = controller.header
        self._note_fault(header[stepper.FAULTS] | (FAULT_LOST if lost else 0))
        header[stepper.FAULTS] = 0
        for motor in range(controller.count):
            block = controller.axes[motor].block
            if block[stepper.FAULT] & stepper.FAULT_LATE:
                lost |= 1 << motor  # its pulses broke off in motion, so it may have slipped
            block[stepper.FAULT] = 0
        if lost:
            controller.positions.set_lost(lost, STEPS)
        self.fault_stop()

    def on_driver_failure(self, bits):
        """The drivers of these motors have failed (io/tmc2209.py).

        Those that were on have lost their positions, and everything comes to rest.
        """
        motors = self.controller.motors
        bits &= motors.powered
        if bits:
            motors.switch_off(bits)
            self.controller.positions.set_lost(bits, DRIVER)
            self._note_fault(FAULT_DRIVER)
            self.fault_stop()

    def check_pins(self):
        """Returns whether all pins are as the HAL has set them up.

        If a program on the REPL has changed some, the HAL takes them back, everything stops, and
        motors that may have missed pulses have lost their positions.
        """
        hal = self.controller.hal
        lost = hal.reclaim()
        if lost < 0:
            return hal.ready()
        self.controller.positions.set_lost(lost, STEPS)
        self._note_fault(FAULT_TAKEN)
        self.fault_stop()
        return False

    def stop_all(self):
        """MSG_MOTOR_STOP_ALL: all motors ramp down. Flags are ignored.

        Within SECOND_STOP_MS of another one, or while JOG_ALL comes to rest on a frame, it is the
        hard stop (field notes 4.4 and 6.10). Returns OK.
        """
        controller = self.controller
        operations = controller.operations
        virtuals = controller.virtuals
        now = controller.now
        hard = operations.stopping_on_frame
        if self.stop_all_at >= 0 and elapsed(now, self.stop_all_at) <= SECOND_STOP_MS:
            hard = True
        factor = controller.rig.hard_stop_factor if hard else 1
        self.stop_all_at = now
        controller.motors.jogging = 0
        self.end_homing()
        landing = operations.stop(factor, not hard, True, spared=virtuals.engaged)
        if hard:
            virtuals.halt(factor)
        else:
            virtuals.stop()
            landing |= virtuals.engaged
        controller.axes.stop(factor, landing, not hard)
        return m.OK
