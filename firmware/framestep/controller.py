"""The controller: dispatches each message to the subsystem it is for, and reports.

One pass of the main loop is poll(). Nothing in it allocates.
"""

from framestep.clock import WRAP, elapsed
from framestep.io.requests import GO, STOP, Io
from framestep.io.safety import Safety
from framestep.io.watchdog import LOOK_MS, Watchdog
from framestep.motion import stepper
from framestep.motion.stepper import sample
from framestep.motors.axes import Axes
from framestep.motors.positions import DRIVER, STEPS
from framestep.motors.requests import Motors
from framestep.moves.operations import ENDING, LEAVING, POSITIONING, READY, RUNNING
from framestep.moves.requests import Moves
from framestep.native import const
from framestep.protocol import messages as m
from framestep.protocol.frames import DAMAGED, NOTHING, FrameReader, FrameWriter
from framestep.reports import Reports

_TEND_MS = const(4)  # from one whole pass to the next
_AWAKE = const(12)  # whole passes after anything has happened, less _NAP;
_NAP = const(4)  # then one in so many
_REPLY_ROOM = const(128)  # payload bytes: the largest answer, and an acknowledgement
STALL_MS = const(200)  # a frame that is not whole so long after its beginning is given up,
_QUIET_MS = const(10)  # unless its bytes are still coming in: the passes themselves may have been away

# What `fault` tells, with the kernel's FAULT_ bits below; framestep.words has the words
FAULT_LOST = const(0x10)
FAULT_ESTOP = const(0x20)
FAULT_LIMIT = const(0x40)
FAULT_DRIVER = const(0x80)
FAULT_TAKEN = const(0x100)

# The LED: a bit for each eighth of a second, the lowest first (128 ms each), and the colour of one that has colours
LED_WAITING = (0x0001, 0x000030)
LED_CONNECTED = (0xFFFF, 0x080808)
LED_MOVING = (0x5555, 0x002000)
LED_FAULT = (0x0015, 0x300000)

# Requests that leave alone what an operation has planned before GO, and motors that have yet to set out after it
_ASIDE = (
    m.MSG_RT_GO,
    m.MSG_MOTOR_STATUS,
    m.MSG_MOTOR_GET_POSITION,
    m.MSG_HI,
    m.MSG_CONDITION,
    m.MSG_EXCEEDED,
    m.MSG_DMX,
    m.MSG_GIO_OUT,
    m.MSG_GIO_IN,
    m.MSG_GIO_CAM,
    m.MSG_VIRT_GET_POSITION,
)

SECOND_STOP_MS = const(1000)  # field note 4.4


def glow(light, beat):
    """What the LED shows in this of 16 beats: a colour 0xRRGGBB, or 0. light: one of LED_."""
    return light[1] if light[0] >> beat & 1 else 0


class Controller:
    """Answers the host and keeps everything moving. hal: see framestep.hal; rig: framestep.rig.Rig."""

    def __init__(self, hal, rig, broken=False):
        """broken: the rig file has a mistake; the board answers, but nothing moves."""
        self.hal = hal
        self.rig = rig
        self.broken = broken
        self.port = hal.port
        self.reader = FrameReader()
        self.writer = FrameWriter(m.LARGEST_FRAME)
        self.axes = Axes(hal)
        self.header = hal.kernel.state  # of the tick
        self.samples = self.axes.samples
        self.positions = self.axes.positions
        self.safety = Safety(hal, rig, self.axes)
        self.watchdog = Watchdog(hal, self.writer)
        self.io = Io(hal, rig, self.reader, self.writer, self.safety)
        self.drivers = None
        if rig.drivers:
            from framestep.io.tmc2209 import Drivers

            self.drivers = Drivers(hal, rig)
        self.count = hal.motors
        self.motors = Motors(self)
        self.moves = Moves(self)
        self.operations = self.moves.operations
        self.operations.player.strict = rig.strict_moves
        self.journal = self._remember() if rig.remember_positions else None
        self.run_outputs = self.moves.run_outputs
        self.now = 0
        self.tended = 0
        self.awake = _AWAKE
        self.planning = False  # the next pass plans on
        self.unsent = False  # the port was still at something else
        self.backlog = False  # requests wait until there is room for their answers
        self.was_open = False
        self.openings = 0
        self.heard_at = 0  # when the last bytes came
        self.begun_at = 0  # and the first ones that no whole frame has been made of
        self.stop_at = -1
        self.fault = 0  # why the motors were stopped, until some are sent somewhere again
        self.untold = 0  # the same, until the HAL has told it
        self.beat = 0
        self.reports = Reports(self)
        self.handlers = {
            m.MSG_HI: self._hi,
            m.MSG_MOTOR_STATUS: self._status,
            m.MSG_MOTOR_STOP_ALL: self.stop_all,
            m.MSG_MOTOR_GET_POSITION: self._get_position,
            m.MSG_CONDITION: self._condition,
        }
        parts = [self.motors, self.moves, self.io]
        if rig.virtuals:
            from framestep.virtuals.requests import Virtuals

            self.virtuals = Virtuals(self)
        else:
            from framestep.virtuals.absent import NoVirtuals

            self.virtuals = NoVirtuals()
        parts.append(self.virtuals)
        for part in parts:
            self.handlers.update(part.handlers)
            part.handlers = None  # which would only keep memory

    def _remember(self):
        from framestep.io.position_journal import PositionJournal
        from framestep.io.restore import restore

        try:
            journal = PositionJournal(self.hal.flash(), self.axes)
            restore(journal)
            return journal
        except OSError as error:
            if self.rig.ports == 2:  # else the REPL's port is the protocol's
                print("framestep: positions cannot be remembered:", error)
            return None

    # ---------------------------------------------------------------- the main loop

    def poll(self, now):
        """One pass; now: milliseconds modulo 2^29 or more. Returns whether there was anything to do."""
        now &= WRAP
        self.now = now
        alarm = sample(self.header, self.samples)
        busy = self._listen()
        if busy:
            self.awake = _AWAKE
            self.planning = True
        if busy or self.unsent:
            self.unsent = self.port.send(self.writer)
        news = self.io.poll(now)
        if news:
            if news & STOP:
                self._halt()
            if news & GO and self.moves.go_from_input():
                self.reports.go = self.planning = True
        if self.drivers:
            bits = self.drivers.poll(now)
            if bits:
                self._drivers_failed(bits)
        if self.run_outputs.busy:
            self.run_outputs.poll()
        if alarm and self.operations.state == RUNNING and self.operations.reached():
            self.reports.position = self.reports.frame = True
            self.awake = _AWAKE  # a run of lights alone moves nothing that would keep it so
            self._tend(now, False, news)
        elif (
            self.reports.was_moving
            and elapsed(now, self.reports.sent_at) >= self.rig.report_ms
            and elapsed(now, self.tended) < 2 * _TEND_MS
        ):
            self._tend(now, False, news)
        elif elapsed(now, self.tended) >= _TEND_MS or news:
            self.tended = now
            self._tend(now, True, news)
        elif self.planning:
            self._plan(now)
            if self.operations.rt_end_due:
                self._tend(now, False, news)
        return busy

    def _tend(self, now, whole, news):
        """What is done every few milliseconds, so that requests are answered soon between: queues, faults, reports.

        whole: if not, what is to be planned waits for the next pass. news: of Io.poll().
        """
        if elapsed(now, self.watchdog.looked_at) >= LOOK_MS:
            self._sound()
            if self.watchdog.look(now, self.reports.was_moving, self.was_open):
                self._host_lost()
        if now >> 7 & 15 != self.beat:
            self._light(now >> 7 & 15)
        look = stepper.look(self.header)
        if look or news:
            self.awake = _AWAKE
        elif self.awake > _NAP:
            self.awake -= 1
        elif self.awake > 0:
            self.awake -= 1
            return
        else:
            self.awake = _NAP  # now and then, for what had to wait until the host takes it
        if self.motors.jogging:
            self.motors.end_jogs()
        if whole:
            self._plan(now)
        else:
            self.planning = True
        lost = self.hal.trouble()
        if lost or look & stepper.LOOK_FAULT:
            self._fault(lost)
        self.reports.send()
        if self.journal:
            self.journal.poll(now, self.reports.was_moving or self.operations.busy or self.virtuals.engaged)
        self.unsent = self.port.send(self.writer)

    def _plan(self, now):
        """A piece of what is to be planned, a frame or segments of one motor: the rest waits for the next pass."""
        planned = self.virtuals.poll(now)
        if self.moves.poll():
            planned = True
        self.planning = self.axes.feed(planned) or planned

    def _listen(self):
        """Take in what has come and answer it."""
        port = self.port
        reader = self.reader
        is_open = port.open
        if is_open != self.was_open or port.openings != self.openings:
            self.openings = port.openings
            if self.was_open:
                reader.clear()
                self.writer.clear()
                self._host_lost()
            self.was_open = is_open
            if is_open:
                self.reports.hi = True  # field note 1.5
            self.awake = _AWAKE
        waiting = reader.waiting
        if port.poll(reader):
            self.heard_at = self.now
            if not waiting:
                self.begun_at = self.now
        elif not reader.waiting and not self.backlog:
            return False
        return self._attend(reader)

    def _attend(self, reader):
        """Answer what has come; whether there was anything."""
        state = self.operations.state
        if state == POSITIONING or state == ENDING:
            self.operations.poll()  # answers tell how it stands now
        writer = self.writer
        busy = False
        self.backlog = True
        while writer.room() >= _REPLY_ROOM:
            found = reader.poll()
            if found == NOTHING:
                # Since its beginning: a host that goes on asking would lend its bytes to a damaged length for seconds.
                if (
                    reader.waiting
                    and elapsed(self.now, self.begun_at) > STALL_MS
                    and elapsed(self.now, self.heard_at) >= _QUIET_MS
                ):
                    reader.abandon()
                    self.begun_at = self.heard_at
                    continue
                self.backlog = False
                break
            busy = True
            self.begun_at = self.now
            code = m.ERR_CHECKSUM if found == DAMAGED else self._handle(reader)
            if code:
                writer.ack(reader, code, self.rig.wide)
            if not reader.waiting:
                self.backlog = False
                break
        return busy

    def _handle(self, reader):
        """Do what is asked for. The code to acknowledge with, or 0 where the answer has been given."""
        if self.motors.pending_acceleration:
            self.motors.apply_pending_acceleration()
        kind = reader.type
        state = self.operations.state
        if (state == READY or state == LEAVING) and kind not in _ASIDE:
            if state == READY:
                self.operations.discard_early_plan()
            elif kind != m.MSG_MOTOR_STOP_ALL:
                self.operations.send_waiting()
        handler = self.handlers.get(kind)
        if handler is None:
            return m.ERR_UNSUPPORTED
        if not m.payload_fits(kind, reader.length):
            return m.ERR_RANGE
        return handler()

    def _host_lost(self):
        """The host has closed the port: everything comes to rest (field note 1.11)."""
        ready = self.hal.ready()
        self.operations.host_lost(ready, self.virtuals.engaged)
        if ready:
            self.virtuals.stop()
            self.axes.stop(1, self.virtuals.engaged, True)
        else:
            self.virtuals.halt()  # no motor may turn round on the way to rest
            self.axes.stop()
        self.io.safe()
        self.run_outputs.abort()
        self.motors.jogging = 0
        self.reports.nobody_listens()

    def abandon(self):
        """The firmware stops looking after the motors: they ramp down, outputs go to their safe levels."""
        self.io.safe()
        self.operations.stop()
        self.run_outputs.abort()
        self.virtuals.halt()
        self.axes.stop()

    def give_up(self):
        """An exception has ended the passes: as abandon(), and the host is told (field note 8.4)."""
        self.abandon()
        self.writer.begin(m.MSG_MOTOR_HARD_STOP, None)
        self.writer.u8(m.HARD_STOP_FAULT)
        self.writer.end()
        self.port.send(self.writer)

    def fail(self):
        """An internal fault: everything comes to rest, the host is told (field note 8.4)."""
        self.abandon()
        self.motors.jogging = 0
        self.reports.hard_stop = m.HARD_STOP_FAULT

    def _blame(self, fault):
        """Keep why the motors are stopped. fault: FAULT_ bits."""
        self.fault |= fault
        self.untold |= fault

    def _halt(self):
        """A stop input has acted (field note 8.4)."""
        factor = self.rig.hard_stop_factor
        if self.safety.tripped:
            if self.rig.estop_cuts_power:
                self.positions.power_cut(self.axes.moving_bits())
            self._blame(FAULT_ESTOP)
            self.motors.jogging = 0
            self.operations.stop(factor)
            self.virtuals.halt(factor)
            self.axes.stop(factor)
            self.io.safe()
            self.run_outputs.abort()
            return
        bits = self.safety.struck_motors()
        if bits:
            self._blame(FAULT_LIMIT)
        self.motors.jogging &= ~bits
        if self.virtuals.engaged & bits:
            self.virtuals.halt()
        for motor in range(self.count):
            if bits >> motor & 1:
                if self.operations.takes(motor):
                    self.operations.stop(spared=self.virtuals.engaged)
                self.axes[motor].stop(self.hal, factor)

    def _fault(self, lost):
        """The tick kernel has found a fault, or the engine has lost a command of motors of the bits `lost`."""
        header = self.header
        self._blame(header[stepper.FAULTS] | (FAULT_LOST if lost else 0))
        header[stepper.FAULTS] = 0
        for motor in range(self.count):
            block = self.axes[motor].block
            if block[stepper.FAULT] & stepper.FAULT_LATE:
                lost |= 1 << motor  # its pulses broke off in motion, which it may not have followed
            block[stepper.FAULT] = 0
        if lost:
            self.positions.set_lost(lost, STEPS)
        self.fail()

    def _drivers_failed(self, bits):
        """Drivers of these motors no longer do what they are told (io/tmc2209.py). Motors that were switched on may be
        anywhere now: everything comes to rest, and their positions are lost."""
        bits &= self.motors.powered
        if bits:
            self.motors.switch_off(bits)
            self.positions.set_lost(bits, DRIVER)
            self._blame(FAULT_DRIVER)
            self.fail()

    def _light(self, beat):
        """Switch the LED as its pattern has it."""
        self.beat = beat
        if self.fault or self.broken or self.safety.tripped:
            light = LED_FAULT
        elif self.reports.was_moving:
            light = LED_MOVING
        else:
            light = LED_CONNECTED if self.was_open else LED_WAITING
        self.hal.led(glow(light, beat))

    def _sound(self):
        """Whether all pins are what they should be. Else everything stops, and motors that may have missed pulses have
        lost their positions; the next time they are."""
        lost = self.hal.reclaim()
        if lost < 0:
            return self.hal.ready()
        self.positions.set_lost(lost, STEPS)
        self._blame(FAULT_TAKEN)
        self.fail()
        return False

    def safe(self):
        """Whether motors may be moved at all."""
        return not self.broken and not self.safety.tripped and self._sound()

    def acknowledge(self, code):
        """Answer the request at once, before it is carried out."""
        self.writer.ack(self.reader, code, self.rig.wide)
        self.port.send(self.writer)

    def stop_all(self):
        """spec: MSG_MOTOR_STOP_ALL. Harder where it comes again within SECOND_STOP_MS."""
        hard = (
            self.operations.stopping_on_frame or self.stop_at >= 0 and elapsed(self.now, self.stop_at) <= SECOND_STOP_MS
        )
        factor = self.rig.hard_stop_factor if hard else 1
        self.stop_at = self.now
        self.motors.jogging = 0
        landing = self.operations.stop(factor, not hard, True, spared=self.virtuals.engaged)
        if hard:
            self.virtuals.halt(factor)
        else:
            self.virtuals.stop()
            landing |= self.virtuals.engaged
        self.axes.stop(factor, landing, not hard)
        return m.OK

    # ---------------------------------------------------------------- requests: device
    #
    # A handler returns the code to acknowledge with, or 0 where it has answered itself.

    def _hi(self):
        self.reports.send_hi(self.reader)
        self.reports.hi = False
        return 0

    def _get_position(self):
        self.reports.send_positions(self.reader)
        return 0

    def _status(self):
        writer = self.writer
        writer.begin(m.MSG_MOTOR_STATUS, self.reader)
        writer.u32(stepper.moving(self.header) | self.operations.engaged | self.virtuals.engaged)
        writer.u8(1 if self.io.lights.adjusting else 0)
        writer.end()
        return 0

    def condition(self):
        """CONDITION_ bits; framestep.words says them in words."""
        bits = 0
        if self.broken:
            bits |= m.CONDITION_BROKEN
        if self.safety.tripped:
            bits |= m.CONDITION_ESTOP
        if self.hal.watchdog.barked:
            bits |= m.CONDITION_BARKED
        if self.drivers and self.drivers.ready != (1 << self.count) - 1:
            bits |= m.CONDITION_DRIVER
        if self.operations.player.exceeded[0]:
            bits |= m.CONDITION_EXCEEDED
        if self.rig.remember_positions:
            if self.journal is None or not self.journal.working:
                bits |= m.CONDITION_FORGETFUL
            else:
                bits |= m.CONDITION_KEPT if self.positions.saved else m.CONDITION_UNKEPT
        return bits

    def _condition(self):
        """framestep's own: CONDITION_ bits 0, then state and reason of each motor's position (motors/positions.py)."""
        writer = self.writer
        positions = self.positions
        writer.begin(m.MSG_CONDITION, self.reader)
        writer.u32(self.condition())
        for i in range(self.count):
            writer.u8(positions.states[i])
            writer.u8(positions.reasons[i])
        writer.end()
        return 0
