"""The controller: dispatches each message to the subsystem it is for, and reports.

One pass of the main loop is poll(). Nothing in it allocates.
"""

from array import array

from framestep.clock import WRAP, elapsed
from framestep.io.requests import GO, STOP, Io
from framestep.io.safety import Safety
from framestep.io.watchdog import LOOK_MS, Watchdog
from framestep.motion import axes as motion
from framestep.motion import stepper
from framestep.motion.axes import Axes
from framestep.motion.positions import DRIVER, STEPS
from framestep.motion.stepper import sample
from framestep.moves.requests import Moves
from framestep.moves.stage import ENDING, LEAVING, POSITIONING, READY, RUNNING
from framestep.native import const
from framestep.protocol import messages as m
from framestep.protocol.frames import DAMAGED, NOTHING, FrameReader, FrameWriter

VERSION = (0, 1, 0)
CAPABILITIES = m.CAP_REALTIME | m.CAP_GO_MOTION | m.CAP_GO_MOTION2 | m.CAP_LOOP | m.CAP_CAMERA | m.CAP_COUPLE

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

_COUPLING = const(m.MOTOR_COUPLE | m.MOTOR_COUPLE_REVERSED)
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
        for i in range(self.count):
            self.axes[i].set_jerk(rig.motor(i)["jerk"])
            self.axes.set_backlash(i, rig.motor(i)["backlash"])
        self.moves = Moves(self)
        self.stage = self.moves.stage
        self.stage.follower.strict = rig.strict_moves
        self.memory = self._remember() if rig.remember_positions else None
        self.show = self.moves.show
        self.flags = array("i", [m.MOTOR_ENABLED] * self.count)
        # steps/s that a motor can do with its pulses
        kernel = hal.kernel
        per_second = motion.TICKS_PER_SECOND * kernel.state[stepper.CYCLES]
        self.fastest = array("i", [min(motion.FASTEST, per_second // b[stepper.SHORTEST]) for b in kernel.blocks])
        self.powered = 0  # bits of motors whose driver is on
        self.gentler = 0  # bits of motors that wait for a lower acceleration
        self.jogging = 0  # bits of motors that jog
        self.jog_at = array("i", [0] * self.count)
        self.words = array("i", [0] * 2)
        self.now = 0
        self.tended = 0
        self.awake = _AWAKE
        self.planning = False  # the next pass plans on
        self.unsent = False  # the port was still at something else
        self.backlog = False  # requests wait until there is room for their answers
        self.was_open = False
        self.openings = 0
        self.was_moving = False
        self.report_at = 0
        self.heard_at = 0  # when the last bytes came
        self.begun_at = 0  # and the first ones that no whole frame has been made of
        self.stop_at = -1
        self.fault = 0  # why the motors were stopped, until some are sent somewhere again
        self.untold = 0  # the same, until the HAL has told it
        self.beat = 0
        # what is to be sent unasked, kept until there is room
        self.say_hi = False
        self.say_position = False
        self.say_frame = False  # that is of the frame reached last
        self.say_virtual = False
        self.say_end = False
        self.say_go = False
        self.say_hard_stop = m.HARD_STOP_FAULT if hal.watchdog.barked else -1
        self.handlers = {
            m.MSG_HI: self._hi,
            m.MSG_MOTOR_STATUS: self._status,
            m.MSG_MOTOR_MOVE: self._move,
            m.MSG_MOTOR_STOP: self._stop,
            m.MSG_MOTOR_STOP_ALL: self.stop_all,
            m.MSG_MOTOR_GET_POSITION: self._get_position,
            m.MSG_MOTOR_RESET_POSITION: self._reset_position,
            m.MSG_MOTOR_JOG: self._jog,
            m.MSG_MOTOR_CONFIGURE: self._configure,
            m.MSG_MOTOR_SET_SPEED: self._set_speed,
            m.MSG_MOTOR_SET_LIMITS: self._set_limits,
            m.MSG_CONDITION: self._condition,
            m.MSG_EXCEEDED: self._exceeded,
        }
        parts = [self.moves, self.io]
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
        from framestep.io.memory import Memory
        from framestep.io.restore import restore

        try:
            memory = Memory(self.hal.flash(), self.axes)
            restore(memory)
            return memory
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
                self.say_go = self.planning = True
        if self.drivers:
            bits = self.drivers.poll(now)
            if bits:
                self._drivers_failed(bits)
        if self.show.busy:
            self.show.poll()
        if alarm and self.stage.state == RUNNING and self.stage.reached():
            self.say_position = self.say_frame = True
            self.awake = _AWAKE  # a run of lights alone moves nothing that would keep it so
            self._tend(now, False, news)
        elif (
            self.was_moving
            and elapsed(now, self.report_at) >= self.rig.report_ms
            and elapsed(now, self.tended) < 2 * _TEND_MS
        ):
            self._tend(now, False, news)
        elif elapsed(now, self.tended) >= _TEND_MS or news:
            self.tended = now
            self._tend(now, True, news)
        elif self.planning:
            self._plan(now)
            if self.stage.ended:
                self._tend(now, False, news)
        return busy

    def _tend(self, now, whole, news):
        """What is done every few milliseconds, so that requests are answered soon between: queues, faults, reports.

        whole: if not, what is to be planned waits for the next pass. news: of Io.poll().
        """
        if elapsed(now, self.watchdog.looked_at) >= LOOK_MS:
            self._sound()
            if self.watchdog.look(now, self.was_moving, self.was_open):
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
        if self.jogging:
            self._jogs()
        if whole:
            self._plan(now)
        else:
            self.planning = True
        lost = self.hal.trouble()
        if lost or look & stepper.LOOK_FAULT:
            self._fault(lost)
        self._report()
        if self.memory:
            self.memory.poll(now, self.was_moving or self.stage.busy or self.virtuals.engaged)
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
                self.say_hi = True  # field note 1.5
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
        state = self.stage.state
        if state == POSITIONING or state == ENDING:
            self.stage.poll()  # answers tell how it stands now
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

    def _calm(self):
        """Motors that have come to rest take the lower acceleration that they were set to under way."""
        for i in range(self.count):
            if self.gentler >> i & 1 and self.axes[i].calm():
                self.gentler ^= 1 << i

    def _handle(self, reader):
        """Do what is asked for. The code to acknowledge with, or 0 where the answer has been given."""
        if self.gentler:
            self._calm()
        kind = reader.type
        state = self.stage.state
        if (state == READY or state == LEAVING) and kind not in _ASIDE:
            if state == READY:
                self.stage.retract()
            elif kind != m.MSG_MOTOR_STOP_ALL:
                self.stage.set_off()
        handler = self.handlers.get(kind)
        if handler is None:
            return m.ERR_UNSUPPORTED
        if not m.payload_fits(kind, reader.length):
            return m.ERR_RANGE
        return handler()

    def _host_lost(self):
        """The host has closed the port: everything comes to rest (field note 1.11)."""
        ready = self.hal.ready()
        self.stage.leave(ready, self.virtuals.engaged)
        if ready:
            self.virtuals.stop()
            self.axes.stop(1, self.virtuals.engaged, True)
        else:
            self.virtuals.halt()  # no motor may turn round on the way to rest
            self.axes.stop()
        self.io.safe()
        self.show.abort()
        self.jogging = 0
        self.say_hi = self.say_position = self.say_end = self.say_go = False

    def abandon(self):
        """The firmware stops looking after the motors: they ramp down, outputs go to their safe levels."""
        self.io.safe()
        self.stage.stop()
        self.show.abort()
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
        self.jogging = 0
        self.say_hard_stop = m.HARD_STOP_FAULT

    def _blame(self, fault):
        """Keep why the motors are stopped. fault: FAULT_ bits."""
        self.fault |= fault
        self.untold |= fault

    def _halt(self):
        """A stop input has acted (field note 8.4)."""
        factor = self.rig.hard_stop_factor
        if self.safety.tripped:
            if self.rig.estop_cuts_power:
                self.positions.cut(self.axes.moving_bits())
            self._blame(FAULT_ESTOP)
            self.jogging = 0
            self.stage.stop(factor)
            self.virtuals.halt(factor)
            self.axes.stop(factor)
            self.io.safe()
            self.show.abort()
            return
        bits = self.safety.struck_motors()
        if bits:
            self._blame(FAULT_LIMIT)
        self.jogging &= ~bits
        if self.virtuals.engaged & bits:
            self.virtuals.halt()
        for motor in range(self.count):
            if bits >> motor & 1:
                if self.stage.takes(motor):
                    self.stage.stop(spared=self.virtuals.engaged)
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
            self.positions.lose(lost, STEPS)
        self.fail()

    def _drivers_failed(self, bits):
        """Drivers of these motors no longer do what they are told (io/tmc2209.py). Motors that were switched on may be
        anywhere now: everything comes to rest, and their positions are lost."""
        bits &= self.powered
        if bits:
            self.powered &= ~bits
            for motor in range(self.count):
                if bits >> motor & 1:
                    self.hal.enable(motor, False)
            self.positions.lose(bits, DRIVER)
            self._blame(FAULT_DRIVER)
            self.fail()

    def _light(self, beat):
        """Switch the LED as its pattern has it."""
        self.beat = beat
        if self.fault or self.broken or self.safety.tripped:
            light = LED_FAULT
        elif self.was_moving:
            light = LED_MOVING
        else:
            light = LED_CONNECTED if self.was_open else LED_WAITING
        self.hal.led(glow(light, beat))

    # ---------------------------------------------------------------- reports

    def _report(self):
        """Send what is due, as far as there is room (field notes 1.3 and 4.6)."""
        moving = stepper.moving(self.header) != 0
        if moving:
            if elapsed(self.now, self.report_at) >= self.rig.report_ms:
                self.say_position = True
        elif self.was_moving:
            self.say_position = True
        self.was_moving = moving
        if self.stage.ended:
            self.stage.ended = False
            self.say_position = True
            self.say_end = True
        self.io.report(self.was_open)
        if not self.was_open:
            self.say_position = self.say_frame = self.say_virtual = False
            self.say_end = self.say_go = False
            return
        if self.say_hi and self._send_hi(None):
            self.say_hi = False
        if self.say_hard_stop >= 0:
            self.writer.begin(m.MSG_MOTOR_HARD_STOP, None)
            self.writer.u8(self.say_hard_stop)
            if self.writer.end():
                self.say_hard_stop = -1
        if self.say_virtual and (not self.virtuals.configured or self.virtuals.send_positions(None)):
            self.say_virtual = False  # field note 9.8
        if self.say_position and self._send_positions(None, self.say_frame):
            self.say_position = self.say_frame = False
            self.report_at = self.now
            self.say_virtual = self.virtuals.configured  # a pass later, since they are to be calculated
        if self.say_go:
            self.writer.begin(m.MSG_RT_GO, None)
            if self.writer.end():
                self.say_go = False
        if self.say_end and not self.say_position and not self.say_go:
            self.writer.begin(m.MSG_RT_END, None)
            if self.writer.end():
                self.say_end = False

    def _send_hi(self, reader):
        writer = self.writer
        writer.begin(m.MSG_HI, reader)
        writer.text(self.rig.name, m.HI_NAME_BYTES)
        writer.u8(VERSION[0])
        writer.u8(VERSION[1])
        writer.u8(VERSION[2])
        writer.u8(self.count)
        writer.u16(self.io.lights.count)
        writer.u8(self.io.gio.outputs.count)
        writer.u8(self.io.gio.inputs.count)
        writer.u8(len(self.rig.limits))
        writer.u32(self.moves.upload_frames)
        writer.u32(CAPABILITIES | self.virtuals.capabilities)
        writer.u16(m.PROTOCOL_VERSION)
        return writer.end()

    def _send_positions(self, reader, frame=False):
        """MOTOR_GET_POSITION: MOVE TIME and positions of one moment, that of the pins (field note 4.6).

        frame: of the frame that has been reached last.
        """
        writer = self.writer
        writer.begin(m.MSG_MOTOR_GET_POSITION, reader)
        writer.u32(self.stage.tell(frame))
        writer.words_from(self.axes.told, 0, self.count)
        return writer.end()

    # ---------------------------------------------------------------- requests: device
    #
    # A handler returns the code to acknowledge with, or 0 where it has answered itself.

    def _hi(self):
        self._send_hi(self.reader)
        self.say_hi = False
        return 0

    def _status(self):
        writer = self.writer
        writer.begin(m.MSG_MOTOR_STATUS, self.reader)
        writer.u32(stepper.moving(self.header) | self.stage.engaged | self.virtuals.engaged)
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
        if self.stage.follower.exceeded[0]:
            bits |= m.CONDITION_EXCEEDED
        if self.rig.remember_positions:
            if self.memory is None or not self.memory.working:
                bits |= m.CONDITION_FORGETFUL
            else:
                bits |= m.CONDITION_KEPT if self.positions.settled else m.CONDITION_UNKEPT
        return bits

    def _condition(self):
        """framestep's own: CONDITION_ bits 0, then state and reason of each motor's position (motion/positions.py)."""
        writer = self.writer
        positions = self.positions
        writer.begin(m.MSG_CONDITION, self.reader)
        writer.u32(self.condition())
        for i in range(self.count):
            writer.u8(positions.states[i])
            writer.u8(positions.reasons[i])
        writer.end()
        return 0

    def _exceeded(self):
        """framestep's own: EXCEEDED_ 0, motor 1, scene frame 2, by how much 6 (steps/s or steps/s²).

        Then what is set for a motor, that one or the one that the request names: motor 10, velocity 11, acceleration
        15, soft limits 19 (lower), 23 (upper), SET_ bits 27; and limit sets whose upper 28, whose lower switch 30 is
        active, a bit each.
        """
        writer = self.writer
        exceeded = self.stage.follower.exceeded
        motor = self.reader.u8(0) - 1 if self.reader.length else exceeded[1]
        if motor < 0 or motor >= self.count:
            return m.ERR_RANGE
        writer.begin(m.MSG_EXCEEDED, self.reader)
        writer.u8(exceeded[0])
        writer.u8(exceeded[1] + 1 if exceeded[0] else 0)
        writer.words_from(exceeded, 2, 1)
        writer.words_from(exceeded, 3, 1)
        axis = self.axes[motor]
        writer.u8(motor + 1)
        writer.u32(axis.own_velocity)
        writer.u32(axis.own_acceleration)
        writer.words_from(axis.limits, 0, 2)
        bits = self.safety.ends(motor) << 4  # SET_AT_UPPER, SET_AT_LOWER
        if axis.lower_enabled:
            bits |= m.SET_LOWER
        if axis.upper_enabled:
            bits |= m.SET_UPPER
        if self.flags[motor] & m.MOTOR_ENABLED:
            bits |= m.SET_ENABLED
        if axis.leader:
            bits |= m.SET_LED
        writer.u8(bits)
        writer.u16(self.safety.held(0))
        writer.u16(self.safety.held(1))
        writer.end()
        return 0

    def _get_position(self):
        self._send_positions(self.reader)
        return 0

    # ---------------------------------------------------------------- requests: motors

    def _motor(self):
        """The motor of this request, from 0; -1 where there is no such motor."""
        number = self.reader.u8(0)
        return number - 1 if 0 < number <= self.count else -1

    def _sound(self):
        """Whether all pins are what they should be. Else everything stops, and motors that may have missed pulses have
        lost their positions; the next time they are."""
        lost = self.hal.reclaim()
        if lost < 0:
            return self.hal.ready()
        self.positions.lose(lost, STEPS)
        self._blame(FAULT_TAKEN)
        self.fail()
        return False

    def _may_move(self, motor):
        """OK, or why the motor may not be moved on its own now."""
        if self.broken or self.safety.tripped or not self._sound():
            return m.ERR_GENERAL
        if (
            self.stage.running
            and self.stage.takes(motor)
            or (self.virtuals.engaged >> motor & 1 and not self.virtuals.leads(motor))
        ):
            return m.ERR_MOVING
        if not self.enabled(motor):
            return m.ERR_GENERAL
        return m.OK if self._driven(1 << motor) else m.ERR_GENERAL

    def enabled(self, motor):
        """Whether the motor may be moved: it is enabled, led by no other, and so is the motor coupled to it.

        Two coupled motors move one load: with one of them without power the other must not pull at it.
        """
        axis = self.axes[motor]
        if axis.leader or not self.flags[motor] & m.MOTOR_ENABLED:
            return False
        return not axis.partner or self.flags[motor + 1] & m.MOTOR_ENABLED != 0

    def _leading(self, motor):
        """The motor that decides what this one does: itself, or the one that it follows."""
        return motor - 1 if self.axes[motor].leader else motor

    def _driven(self, bits):
        """Whether the drivers of these motors, and of those coupled to them, do what they are told."""
        return not self.drivers or self._coupled(bits) & ~self.drivers.ready == 0

    def _coupled(self, bits):
        for motor in range(self.count - 1):
            if bits >> motor & 1 and self.axes[motor].partner:
                bits |= 2 << motor
        return bits

    def may_move_all(self):
        """OK, or why no motor may be moved now. An enabled motor whose driver does not work holds up all: a run
        without it would be another run."""
        if self.broken or self.safety.tripped or not self._sound():
            return m.ERR_GENERAL
        if not self._driven(self._bits(m.MOTOR_ENABLED)):
            return m.ERR_GENERAL
        return m.OK

    def moving_all(self, bits):
        """Motors of these bits have been sent somewhere together."""
        self.jogging &= ~bits  # any other goes on, and is let go of in time
        self._power(bits)

    def acknowledge(self, code):
        """Answer the request at once, before it is carried out."""
        self.writer.ack(self.reader, code, self.rig.wide)
        self.port.send(self.writer)

    def _power(self, bits):
        """Switch the drivers on of motors that are to move, and are enabled."""
        self.fault = 0
        bits = self._coupled(bits) & self._bits(m.MOTOR_ENABLED) & ~self.powered
        if self.drivers:
            bits &= self.drivers.ready
        if bits:
            self.powered |= bits
            for motor in range(self.count):
                if bits >> motor & 1:
                    self.hal.enable(motor, True)

    def _move(self):
        motor = self._motor()
        if motor < 0:
            return m.ERR_RANGE
        self.reader.word_to(1, self.words, 0)
        code = self.move(motor)
        if code != m.OK or self.rig.wide:
            return code
        writer = self.writer
        writer.begin(m.MSG_MOTOR_MOVE, self.reader)
        moving = self.axes[motor].moving or self.virtuals.engaged and self.virtuals.leads(motor)
        writer.u8(1 if moving else 0)
        writer.end()
        return 0

    def move(self, motor):
        """Send a motor to the step words[0]. A code; nothing moves unless it is OK."""
        code = self._may_move(motor)
        if code != m.OK:
            return code
        axis = self.axes[motor]
        side = axis.outside(self.words, 0)
        if side:
            return m.ERR_SOFT_UP if side > 0 else m.ERR_SOFT_LOW
        code = self.safety.bars(motor, self.words, 0)
        if code != m.OK:
            return code
        self.jogging &= ~(1 << motor)
        if self.virtuals.leads(motor):
            return self.virtuals.drive(motor, self.words, 0)
        self._power(1 << motor)
        axis.travel(self.hal, self.words, 0)
        return m.OK

    def _stop(self):
        motor = self._motor()
        if motor < 0:
            return m.ERR_RANGE
        motor = self._leading(motor)
        self.jogging &= ~(1 << motor)
        engaged = self.virtuals.engaged
        taken = self.stage.busy and self.stage.takes(motor)
        if taken:
            self.stage.stop(land=True, spared=engaged)
        if engaged >> motor & 1:
            self.virtuals.stop()
        elif not taken:
            self.axes[motor].stop(self.hal, 1, True)
        return m.OK

    def stop_all(self):
        """spec: MSG_MOTOR_STOP_ALL. Harder where it comes again within SECOND_STOP_MS."""
        hard = self.stage.landing or self.stop_at >= 0 and elapsed(self.now, self.stop_at) <= SECOND_STOP_MS
        factor = self.rig.hard_stop_factor if hard else 1
        self.stop_at = self.now
        self.jogging = 0
        landing = self.stage.stop(factor, not hard, True, spared=self.virtuals.engaged)
        if hard:
            self.virtuals.halt(factor)
        else:
            self.virtuals.stop()
            landing |= self.virtuals.engaged
        self.axes.stop(factor, landing, not hard)
        return m.OK

    def _reset_position(self):
        motor = self._motor()
        if motor < 0:
            return m.ERR_RANGE
        axis = self.axes[motor]
        if axis.moving or (self.stage.engaged | self.virtuals.engaged) >> self._leading(motor) & 1:
            return m.ERR_MOVING  # field note 4.5; one that holds still in what runs is about to move
        self.reader.word_to(1, self.words, 0)
        if not axis.set_position(self.words, 0):
            return m.ERR_RANGE
        self.positions.know(motor)
        self.axes.renumbered(motor)
        self.stage.change()
        self.say_position = True
        return m.OK

    def _jog(self):
        motor = self._motor()
        speed = self.reader.u16(1)
        if motor < 0 or speed < 1 or speed > 10000:
            return m.ERR_RANGE
        self.reader.word_to(3, self.words, 0)
        return self.jog(motor, speed)

    def jog(self, motor, speed):
        """Jog a motor towards the step words[0], its soft limit at most. speed: 1 … 10000. A code, as above."""
        code = self._may_move(motor)
        if code != m.OK:
            return code
        axis = self.axes[motor]
        axis.clamp(self.words, 0)
        code = self.safety.bars(motor, self.words, 0)
        if code != m.OK:
            return code
        bit = 1 << motor
        if self.virtuals.leads(motor):
            return self.virtuals.drive(motor, self.words, 0, speed)
        self.jog_at[motor] = self.now
        if not self.jogging & bit or not axis.heads_for(self.words, 0, speed):
            self.jogging |= bit
            self._power(bit)
            axis.travel(self.hal, self.words, 0, speed)
        return m.OK

    def _jogs(self):
        """Let go of motors whose jog has not been asked for again (field note 4.2)."""
        limit = self.rig.jog_timeout_ms
        for motor in range(self.count):
            bit = 1 << motor
            if self.jogging & bit:
                axis = self.axes[motor]
                if not axis.moving:
                    self.jogging &= ~bit
                elif limit and elapsed(self.now, self.jog_at[motor]) >= limit:
                    axis.stop(self.hal, 1, True)
                    self.jogging &= ~bit

    def _configure(self):
        motor = self._motor()
        flags = self.reader.u8(1)
        if motor < 0:
            return m.ERR_RANGE
        axis = self.axes[motor]
        enabled = flags & m.MOTOR_ENABLED
        coupling = (flags ^ self.flags[motor]) & _COUPLING
        if flags != self.flags[motor]:
            engaged = self._coupled(self.stage.engaged)
            virtual = self._coupled(self.virtuals.engaged)
            if coupling:
                engaged |= engaged >> 1  # the next motor is meant as well
                virtual |= virtual >> 1
            if engaged >> motor & 1 or (axis.moving or virtual >> motor & 1) and (coupling or not enabled):
                return m.ERR_MOVING
        if coupling:
            code = self._couple(motor, flags & _COUPLING)
            if code != m.OK:
                return code
        self.flags[motor] = flags
        self.moves.shoot.blurred = self._bits(m.MOTOR_BLUR)
        bit = 1 << motor
        if enabled:
            self._power(bit)
        else:
            self.powered &= ~bit
            self.hal.enable(motor, False)
            self.positions.release(motor)
        self._exclude()
        self.stage.change()
        return m.OK

    def _couple(self, motor, flags):
        """Let the next motor do what this one does, or no longer (field note 3.1)."""
        if motor + 1 >= self.count:
            return m.ERR_RANGE
        axis = self.axes[motor]
        partner = self.axes[motor + 1]
        if partner.moving:
            return m.ERR_MOVING
        if not flags:
            axis.uncouple()
        elif axis.leader or partner.partner or not axis.couple(partner, flags & m.MOTOR_COUPLE_REVERSED):
            return m.ERR_RANGE  # no chains
        return m.OK

    def _exclude(self):
        """Which motors take no part in uploaded moves: disabled, under live control, led by another, coupled to one
        that is disabled."""
        bits = 0
        for motor in range(self.count):
            if not self.enabled(motor) or self.flags[motor] & m.MOTOR_LIVE:
                bits |= 1 << motor
        self.stage.follower.excluded = bits

    def _bits(self, flag):
        """Motors configured with a flag, one bit each."""
        bits = 0
        for motor in range(self.count):
            if self.flags[motor] & flag:
                bits |= 1 << motor
        return bits

    def _set_speed(self):
        motor = self._motor()
        velocity = self.reader.count(1)
        acceleration = self.reader.count(5)
        if motor < 0 or velocity < 1 or velocity > self.fastest[motor]:
            return m.ERR_RANGE
        if acceleration < 0:
            acceleration = motion.STEEPEST
        axis = self.axes[motor]
        axis.set_speed(velocity, acceleration)
        self.stage.change()
        leading = self._leading(motor)
        self.virtuals.changed(leading)
        if self.axes[leading].gentler:
            self.gentler |= 1 << motor
        return m.OK

    def _set_limits(self):
        reader = self.reader
        motor = self._motor()
        hw_set = reader.u8(11)
        if motor < 0 or reader.u8(1) > 1 or reader.u8(6) > 1 or not self.safety.has(hw_set & m.HW_SET_MASK):
            return m.ERR_RANGE
        reader.word_to(2, self.words, 0)
        reader.word_to(7, self.words, 1)
        if not self.axes[motor].set_limits(reader.u8(1) != 0, reader.u8(6) != 0, self.words, 0):
            return m.ERR_RANGE
        self.safety.assign(motor, hw_set & m.HW_SET_MASK, hw_set & m.HW_SET_SWAP)
        self.stage.change()
        motor = self._leading(motor)
        self.virtuals.changed(motor)
        if not (self.stage.playing | self.virtuals.engaged) >> motor & 1:
            self.axes[motor].heed(self.hal)
        return m.OK
