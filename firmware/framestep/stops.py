"""Stopping everything when something goes wrong, and the host's STOP_ALL.

ARCHITECTURE.md has a table of everything that stops motors. Nothing here allocates.
"""

from framestep.base.clock import elapsed
from framestep.base.native import const
from framestep.motors.positions import DRIVER, STEPS
from framestep.protocol import messages as m
from framestep.pulse import stepper

# Bits of `fault`, above the kernel's FAULT_ bits; their texts are in faults.py
FAULT_LOST = const(0x10)
FAULT_ESTOP = const(0x20)
FAULT_LIMIT = const(0x40)
FAULT_DRIVER = const(0x80)
FAULT_TAKEN = const(0x100)
FAULT_CLOCK = const(0x800)
FAULT_HOMING = const(0x400)  # homing.py prints its text

HOMING_REPORT = const(0x400)  # bit of `unreported`: homing has a result to print

SECOND_STOP_MS = const(1000)  # field note 4.4


class FaultLog:
    """Why motors were stopped, FAULT_ bits: `fault` until a motor is sent somewhere again,
    `unreported` until it is printed on the REPL. `unreported` also has bits for other lines.
    `moved`: those of them at which a motor moved."""

    def __init__(self):
        self.fault = 0
        self.unreported = 0
        self.moved = 0

    def note(self, fault, unreported, moved=0):
        """Note why the motors are stopped, what to print on the REPL, and whether any moved."""
        self.moved &= self.unreported  # a line that has yet to be printed keeps its end
        if moved:
            self.moved |= fault
        self.fault |= fault
        self.unreported |= unreported

    def clear(self):
        """Clear the fault, as motors are sent somewhere."""
        self.fault = 0


class Stops:
    """Stops motors and outputs, and keeps the reason. homing may be None. faults: a FaultLog."""

    def __init__(self, rig, link, motion, io, homing, reports, faults):
        self.rig = rig
        self.port = link.port
        self.reader = link.reader
        self.writer = link.writer
        self.axes = axes = motion.axes
        self.interlock = motion.interlock
        self.operations = motion.moves.operations
        self.run_outputs = motion.moves.run_outputs
        self.virtuals = motion.virtuals
        self.io = io
        self.safety = io.safety
        self.homing = homing
        self.reports = reports
        self.faults = faults
        self.hal = hal = axes.hal
        self.header = hal.kernel.state
        self.positions = axes.positions
        self.clock_changed = False  # by a program on the REPL; nothing moves
        self.stop_all_at = -1  # time of the last STOP_ALL, ms

    def allow_motion(self):
        """Return whether the state of the board allows motion."""
        return not self.safety.estop_held and self.check_board()

    def stop_everything(self):
        """Ramp all motors down and set all outputs to their safe levels."""
        self.io.safe()
        self.operations.stop()
        self.run_outputs.abort()
        self.io.safe()  # a tick may have given a cue in the meantime
        self.virtuals.halt()
        self.axes.stop()
        self.interlock.stop_jogging()
        self.interlock.switch_off(self.axes.released)

    def crash_stop(self):
        """After an exception in a pass: stop everything, and report it at once (note 8.4)."""
        self.stop_everything()
        writer = self.writer
        writer.begin(m.MSG_MOTOR_HARD_STOP, None)
        writer.u8(m.HARD_STOP_FAULT)
        writer.end()
        self.port.send(writer)

    def fault_stop(self):
        """After an internal fault: stop everything, and report it soon (field note 8.4)."""
        self.stop_everything()
        self._end_homing()
        self.reports.report_fault()

    def on_host_lost(self):
        """Ramp all motors down, as the host has closed the port or does not read (note 1.11)."""
        virtuals = self.virtuals
        ready = self.hal.ready()
        self.operations.host_lost(ready, virtuals.owned)
        if ready:
            virtuals.stop()
            self.axes.stop(1, virtuals.owned, True)
        else:
            virtuals.halt()  # no motor may turn before it is at rest
            self.axes.stop()
        self.io.safe()
        self.run_outputs.abort()
        self.interlock.stop_jogging()
        self._end_homing()
        self.reports.on_closed()

    def on_stop_input(self):
        """Hard-stop the motors of a stop input that has become active (field note 8.4)."""
        axes = self.axes
        virtuals = self.virtuals
        operations = self.operations
        factor = self.rig.hard_stop_factor
        if self.safety.tripped:
            if self.rig.estop_cuts_power:
                self.positions.power_cut(axes.moving_bits() | self.safety.motors_at_estop())
            self._note(FAULT_ESTOP, axes.moving_bits() | self.safety.motors_at_estop())
            self.interlock.stop_jogging()
            self._end_homing()
            operations.stop(factor)
            virtuals.halt(factor)
            axes.stop(factor)
            self.interlock.switch_off(axes.released)
            self.io.safe()
            self.run_outputs.abort()
            return
        bits = self.safety.motors_at_limit()
        if self.interlock.homing:
            bits = self.homing.take_limit(bits)
        if bits:
            self._note(FAULT_LIMIT, bits)
        self.interlock.stop_jogging(bits)
        if virtuals.owned & bits:
            virtuals.halt()
        for motor in range(self.axes.count):
            if (bits >> motor) & 1:
                if (operations.bits >> motor) & 1:
                    operations.stop(spared=virtuals.owned)
                axes[motor].stop(self.hal, factor)

    def _note(self, fault, moved):
        self.faults.note(fault, fault, moved)

    def _end_homing(self):
        if self.homing:
            self.homing.end()

    def on_fault(self, lost):
        """Handle a fault of the kernel, or lost commands of the motors `lost`."""
        fault = self._take(self.header, stepper.FAULTS) | (FAULT_LOST if lost else 0)
        for motor in range(self.axes.count):
            if self._take(self.axes[motor].block, stepper.FAULT) & stepper.FAULT_LATE:
                lost |= 1 << motor  # its pulses broke off in motion, so it may have slipped
        if lost:
            self.positions.set_lost(lost, STEPS)
        if self._check_clock():  # else it comes from that
            self._note(fault, 1)
            self.fault_stop()

    def _take(self, words, i):
        """Return words[i], to which a tick may add bits, and clear it."""
        irq = self.hal.irq_off()
        bits = words[i]
        words[i] = 0
        self.hal.irq_on(irq)
        return bits

    def on_driver_failure(self, bits):
        """Handle a failure of these motors' drivers (io/tmc2209.py).

        Motors whose drivers were on have lost their positions, and everything comes to rest.
        """
        interlock = self.interlock
        bits &= interlock.powered
        if bits:
            interlock.switch_off(bits)
            self.positions.set_lost(bits, DRIVER)
            self._note(FAULT_DRIVER, self.axes.moving_bits())
            self.fault_stop()

    def _check_clock(self):
        """Return whether the clock is as at the start. If a program on the REPL has changed it,
        pulses come at wrong times: everything stops, and moving motors lose their positions."""
        if self.hal.clock_kept():
            self.clock_changed = False
            return True
        if not self.clock_changed:
            self.clock_changed = True
            moving = self.axes.moving_bits()
            self.positions.set_lost(moving, STEPS)
            self._note(FAULT_CLOCK, moving)
            self.fault_stop()
        return False

    def check_board(self):
        """Return whether the clock and all pins are as the HAL has set them up.

        If a program on the REPL has changed some, the HAL takes them back and everything stops.
        Motors that may have missed pulses have lost their positions.
        """
        if not self._check_clock():
            return False
        hal = self.hal
        lost = hal.reclaim()
        if lost < 0:
            return hal.ready()
        self.positions.set_lost(lost, STEPS)
        self._note(FAULT_TAKEN, self.axes.moving_bits())
        self.fault_stop()
        return False

    def stop_all(self):
        """MSG_MOTOR_STOP_ALL: ramp all motors down. Flags are ignored.

        Within SECOND_STOP_MS of another one, or while JOG_ALL comes to rest on a frame, it is the
        hard stop (field notes 4.4 and 6.10). Returns OK.
        """
        operations = self.operations
        virtuals = self.virtuals
        now = self.reader.now
        hard = operations.stopping_on_frame
        if self.stop_all_at >= 0 and elapsed(now, self.stop_all_at) <= SECOND_STOP_MS:
            hard = True
        factor = self.rig.hard_stop_factor if hard else 1
        self.stop_all_at = now
        if not hard:
            virtuals.stop()  # first, as it takes most time
        self.interlock.stop_jogging()
        self._end_homing()
        landing = operations.stop(factor, not hard, True, spared=virtuals.owned)
        if hard:
            virtuals.halt(factor)
        else:
            landing |= virtuals.owned
        self.axes.stop(factor, landing, not hard)
        return m.OK
