"""The main loop: answers requests, plans ahead, and looks after queues, inputs and faults.

One pass is poll(). Nothing in it allocates.
"""

from framestep.answers import answer, keep_hi, make_answers
from framestep.base.clock import WRAP, elapsed
from framestep.base.native import const
from framestep.base.results import WHAT
from framestep.interlock import Interlock, Motion
from framestep.io.requests import GO, SHOOT, STOP, Io
from framestep.io.safety import Safety
from framestep.io.watchdog import CHECK_MS, Watchdog
from framestep.motors.axes import Axes
from framestep.motors.requests import Motors
from framestep.motors.samples import sample
from framestep.moves.operation_runner import (
    ENDING,
    GONE,
    LEAVING,
    POSITIONING,
    READY,
    RUNNING,
    STARTING,
)
from framestep.moves.requests import Moves
from framestep.protocol import messages as m
from framestep.protocol.frames import DAMAGED, NOTHING
from framestep.protocol.link import Link
from framestep.pulse import stepper
from framestep.reports import Reports
from framestep.stops import FaultLog, Stops

_HOUSEKEEP_MS = const(4)  # between two passes with a complete _housekeep()
_START_MS = const(8)  # after GO no pass does it, unless the start takes longer
# After any activity _ACTIVE_PASSES less _IDLE_EVERY calls of _housekeep() do all of it; when idle,
# only one call in _IDLE_EVERY does.
_ACTIVE_PASSES = const(12)
_IDLE_EVERY = const(4)
_REPLY_ROOM = const(128)  # payload bytes: the largest answer, and an acknowledgement
# A frame that is incomplete STALL_MS after its first byte is dropped, unless bytes came in the last
# _QUIET_MS: then the passes themselves may have been held up.
STALL_MS = const(200)
_QUIET_MS = const(10)

_SHALLOW_MS = const(20)  # a fifth of the time that is queued before a motion begins

# The LED: a bit for each 128 ms, the lowest first, and the colour for LEDs that have colours
LED_WAITING = (0x0001, 0x000030)
LED_CONNECTED = (0xFFFF, 0x080808)
LED_MOVING = (0x5555, 0x002000)
LED_FAULT = (0x0015, 0x300000)


def glow(light, beat):
    """Return the LED's colour in one of 16 beats, 0xRRGGBB; 0 is dark. light: one of LED_."""
    return light[1] if (light[0] >> beat) & 1 else 0


class Controller:
    """Answers the host and keeps everything moving.

    hal: see hal/contract.py. rig: framestep.rig.Rig. broken: the rig file has a mistake; then the
    board answers, but moves nothing.
    """

    def __init__(self, hal, rig, broken=False):
        self.hal = hal
        self.rig = rig
        self.broken = broken
        self.overlay = 0  # CONDITION_OVERLAY or CONDITION_OVERLAY_LEFT_OUT
        link = Link(hal.port, rig.dword_acks)
        self.port = link.port
        self.reader = link.reader
        self.writer = link.writer
        self.axes = Axes(hal)
        if rig.servos:
            self.axes.set_servos(rig)
        self.header = hal.kernel.state  # of the tick
        self.safety = Safety(hal, rig, self.axes)
        self.watchdog = Watchdog(hal, self.writer)
        self.io = Io(hal, rig, link, self.safety)
        self.drivers = None
        if rig.drivers:
            from framestep.io.tmc2209 import Drivers

            self.drivers = Drivers(hal, rig)
        self.faults = FaultLog()
        self.reports = Reports(hal, rig, self.writer, self.axes, self.io)
        self.interlock = Interlock(rig, self.axes, self.drivers, self.faults, broken)
        self.moves = Moves(rig, link, self.axes, self.io, self.interlock, self.faults)
        self.handlers = link.handlers
        self.handlers.update(
            {
                m.MSG_HI: self._hi,
                m.MSG_MOTOR_STATUS: self._status,
                m.MSG_MOTOR_GET_POSITION: self._get_position,
                m.MSG_CONDITION: self._condition,
                m.MSG_LOAD: self._load,
            }
        )
        self.operations = self.moves.operations
        self.run_outputs = self.moves.run_outputs
        self.next_shot = None
        if rig.shoot_input:
            from framestep.moves.next_shot import NextShot

            self.next_shot = NextShot(self.axes, self.interlock, self.moves)
        self.journal = self._restore() if rig.remember_positions else None
        self.now = 0
        self.housekept_at = 0
        self.active_passes = _ACTIVE_PASSES
        self.planning = False  # there is more to plan in the next pass
        self.reported = False  # the last pass was for a report, so this one plans
        self.refused = 0  # for why(): number << 8 | code of the last refused request, or text
        self.unsent = False  # the port has not taken everything yet
        self.backlog = False  # requests wait until there is room for their answers
        self.was_open = False
        self.openings = 0
        self.heard_at = 0  # time of the last bytes
        self.begun_at = 0  # time of the first bytes of an incomplete frame
        self.beat = 0
        if rig.virtuals:
            from framestep.virtual_axes.requests import VirtualAxes

            self.virtuals = VirtualAxes(
                rig, link, self.axes, self.safety, self.operations, self.interlock, self.reports
            )
        else:
            from framestep.virtual_axes.absent import NoVirtuals

            self.virtuals = NoVirtuals()  # type: ignore[assignment]
        motion = Motion(self.axes, self.interlock, self.moves, self.virtuals)
        self.homing = None
        if rig.homing:
            from framestep.homing import Homing

            self.homing = Homing(rig, link, motion, self.io, self.reports, self.faults)
        self.pendant = None
        if rig.pendant:
            from framestep.hand_wheel import Pendant

            self.pendant = Pendant(rig.pendant, motion, self.safety)
        self.motors = Motors(rig, link, motion, self.safety, self.homing, self.reports)
        self.stops = Stops(rig, link, motion, self.io, self.homing, self.reports, self.faults)
        self.interlock.join(self.stops, self.operations, self.virtuals)
        self.reports.join(self.moves, self.virtuals)
        self.handlers[m.MSG_MOTOR_STOP_ALL] = self.stops.stop_all
        self.answers = make_answers(self)

    def _restore(self):
        """Restore the positions of before the power cut. Return the journal, or None without
        one."""
        from framestep.io.position_journal import PositionJournal
        from framestep.io.position_restore import restore

        try:
            journal = PositionJournal(self.hal.flash(), self.axes)
            restore(journal)
            return journal
        except OSError as error:
            if self.rig.ports == 2:  # otherwise the REPL's port is the protocol's
                print("framestep: positions cannot be saved:", error)
            return None

    answer = answer  # for the port

    def answer_hi_at_once(self):
        """Let answer() answer HI as well. At the end of boot, as the answer has to be known."""
        self.reports.send_hi(None)
        keep_hi(self.answers, self.writer._buffer)
        self.writer.clear()

    # ---------------------------------------------------------------- the main loop

    def poll(self, now):
        """Do one pass. now: milliseconds modulo 2^29 or more. Return whether a request came."""
        now &= WRAP
        self.now = self.reader.now = now
        if self.operations.state == GONE:
            self.operations.adopt()
            self.planning = True
            self.active_passes = _ACTIVE_PASSES
        alarm = sample(self.header, self.axes.samples)
        if self.axes.pending:
            self.axes.apply_pending()
        busy = self._listen()
        if busy:
            self.active_passes = _ACTIVE_PASSES
        if busy or self.unsent:
            self.unsent = self.port.send(self.writer)
            if busy and self.unsent:
                self.port.glance()  # what it waits for may have gone since the pass began
            elif busy:
                self.port.look_for_stop()  # glance() lets sections in, which passes store slowly
        news = self.io.poll(now)
        if news:
            if news & STOP:
                self.stops.on_stop_input()
            if news & GO and self.moves.go_from_input() or news & SHOOT and self.next_shot.press():
                self.reports.report_go()
                self.planning = True
        if self.drivers:
            bits = self.drivers.poll(now)
            if bits:
                self.stops.on_driver_failure(bits)
        if self.run_outputs.busy:
            self.run_outputs.poll()
        if alarm and self.operations.state == RUNNING and self.operations.reached():
            self.port.glance()
            self.reports.report_frame()
            self.active_passes = _ACTIVE_PASSES  # a run of lights only does not move anything
            self._housekeep(now, False, news)
            return busy
        reports = self.reports
        if (
            reports.was_moving
            and not self.reported
            and (reports.virtual or elapsed(now, reports.sent_at) >= reports.period_ms)
        ):
            # A report and a piece of planning would be too much for one pass, so they take turns.
            self.reported = self.planning = True
            self._housekeep(now, False, news)
        elif news or (
            elapsed(now, self.housekept_at) >= _HOUSEKEEP_MS
            and not self.reported
            # A start would come a tick later, about one in thirty.
            and (self.operations.state != STARTING or elapsed(now, self.heard_at) > _START_MS)
        ):
            self.reported = False
            self.housekept_at = now
            self._housekeep(now, True, news)
        elif self.planning:
            self.reported = False
            self._plan(now)
            if self.operations.rt_end_due:
                self._housekeep(now, False, news)
        else:
            self.reported = False
        return busy

    def _housekeep(self, now, whole, news):
        """Look after queues, faults and reports, every few milliseconds.

        Not in each pass, so that requests are answered soon. whole: plan as well; otherwise the
        next pass does so. news: result of Io.poll().
        """
        if elapsed(now, self.watchdog.checked_at) >= CHECK_MS:
            self.stops.check_board()
            if self.watchdog.check(now, self.reports.was_moving, self.was_open):
                self.stops.on_host_lost()
            self.port.glance()  # that took half a millisecond
        stepper.waking(self.header)  # often enough for its counter
        self.safety.poll_shared()
        if (now >> 7) & 15 != self.beat:
            self._light((now >> 7) & 15)
            if self.interlock.resting and self.interlock.switch_off_resting():
                self.reports.report_positions()
                self.active_passes = _ACTIVE_PASSES
        flags = stepper.poll_flags(self.header)
        if flags or news or self.operations.rt_end_due:
            self.active_passes = _ACTIVE_PASSES
        elif self.active_passes > _IDLE_EVERY:
            self.active_passes -= 1
        elif self.active_passes > 0:
            self.active_passes -= 1
            return
        else:
            self.active_passes = _IDLE_EVERY  # for messages that could not be sent before
        if self.interlock.jogging:
            self.motors.end_jogs(now)
        if self.homing:
            self.homing.poll(now)
        if self.pendant:
            self.pendant.poll(now)
        if whole:
            self._plan(now)
        else:
            self.planning = True
        lost = self.hal.take_lost_commands()
        if lost or flags & stepper.FLAG_FAULT:
            self.stops.on_fault(lost)
        self.port.glance()  # what follows may take more than a millisecond
        self.reports.send(now, self.was_open)
        if self.journal:
            self.journal.poll(
                now, self.reports.was_moving or self.operations.busy or self.virtuals.owned
            )
        self.unsent = self.port.send(self.writer)

    def _plan(self, now):
        """Plan a piece, such as a frame or segments of one motor; the next pass goes on."""
        planned = self.virtuals.poll(now)
        if self.next_shot:
            self.next_shot.poll()
        self.port.glance()
        if self.moves.poll():
            planned = True
        self.planning = self.axes.feed(planned) or planned

    def _listen(self):
        """Read the port and answer requests. Return whether there was one."""
        port = self.port
        reader = self.reader
        is_open = port.open
        if is_open != self.was_open or port.openings != self.openings:
            self.openings = port.openings
            if self.was_open:
                reader.clear()
                self.writer.clear()
                self.stops.on_host_lost()
            self.was_open = is_open
            if is_open:
                self.reports.report_hi()
            self.active_passes = _ACTIVE_PASSES
        taken = port.poll(reader)
        if taken:
            self.heard_at = self.now
        elif not reader.waiting and not self.backlog:
            return False
        return self._attend(reader, taken)

    def _attend(self, reader, taken):
        """Answer the requests that the reader has. Return whether there was one.

        taken: how many bytes have come in this pass.
        """
        state = self.operations.state
        if state == POSITIONING or state == ENDING:
            self.operations.poll()  # so that answers give the present state
            # RT_END goes out before the answer to the next request, which may begin another
            # operation.
            if self.operations.rt_end_due:
                self.reports.send(self.now, self.was_open)
        writer = self.writer
        busy = False
        self.backlog = True
        while writer.room() >= _REPLY_ROOM:
            found = reader.poll()
            if found == NOTHING:
                if reader.waiting <= taken:
                    self.begun_at = self.now
                # Count from the frame's beginning: after a damaged length, the bytes of a host that
                # goes on sending would be taken for its payload for seconds.
                if (
                    reader.waiting
                    and elapsed(self.now, self.begun_at) > STALL_MS
                    and elapsed(self.now, self.heard_at) >= _QUIET_MS
                ):
                    reader.drop_partial()
                    self.begun_at = self.heard_at
                    continue
                self.backlog = False
                break
            busy = True
            self.begun_at = self.now
            code = m.ERR_CHECKSUM if found == DAMAGED else self._handle(reader)
            if code:
                writer.ack(reader, code, self.rig.dword_acks)
                if code != m.OK:
                    self.refused = reader.type << 8 | code
            if not reader.waiting:
                self.backlog = False
                break
            sample(self.header, self.axes.samples)  # a burst takes tens of ms
        return busy

    def _handle(self, reader):
        """Carry out a request. Return the code to acknowledge it with, 0 if it is answered."""
        kind = reader.type
        if (
            kind != m.MSG_MOTOR_STATUS
            and kind != m.MSG_MOTOR_GET_POSITION
            and kind != m.MSG_RT_UPLOAD_MOVE_AXIS
        ):
            self.planning = True  # at once, not at the next housekeeping
            # Such a request may take tens of milliseconds.
            if self.port.send(self.writer):
                self.port.glance()  # what holds the answers up may have gone
            self.port.look_for_stop()
        state = self.operations.state
        if (state == READY or state == LEAVING) and kind not in m.KEEPS_PLAN:
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

    def _light(self, beat):
        """Show this beat of the LED's pattern."""
        self.beat = beat
        if self.pendant and self.pendant.show(self.now, beat):
            return
        if self.faults.fault or self.broken or self.safety.tripped:
            light = LED_FAULT
        elif self.reports.was_moving:
            light = LED_MOVING
        else:
            light = LED_CONNECTED if self.was_open else LED_WAITING
        self.hal.led(glow(light, beat))

    # ---------------------------------------------------------------- requests: device
    #
    # A handler returns the code to acknowledge with, or 0 if it has answered itself.

    def _hi(self):
        """MSG_HI: answer with what the board can do (field notes 1.4 and 1.5)."""
        self.reports.send_hi(self.reader)
        return 0

    def _get_position(self):
        """MSG_MOTOR_GET_POSITION: answer with MOVE TIME and positions (note 4.6)."""
        self.reports.send_positions(self.reader)
        return 0

    def _status(self):
        """MSG_MOTOR_STATUS (field note 4.7).

        The answer: motors that move or are about to, one bit each; whether lights ramp (8.1).
        """
        writer = self.writer
        writer.begin(m.MSG_MOTOR_STATUS, self.reader)
        writer.u32(stepper.moving(self.header) | self.interlock.owned)
        writer.u8(1 if self.io.lights.adjusting else 0)
        writer.end()
        return 0

    def condition(self):
        """Return the state of the board: CONDITION_ bits. framestep.texts has the texts."""
        bits = self.overlay
        if self.broken:
            bits |= m.CONDITION_RIG_FILE_INVALID
        if self.safety.tripped:
            bits |= m.CONDITION_ESTOP
        if self.hal.watchdog.caused_reset:
            bits |= m.CONDITION_WATCHDOG_RESET
        if self.drivers and self.drivers.ready != (1 << self.axes.count) - 1:
            bits |= m.CONDITION_DRIVER
        if self.operations.exceeded[WHAT]:
            bits |= m.CONDITION_EXCEEDED
        if self.stops.clock_changed:
            bits |= m.CONDITION_CLOCK
        header = self.header
        if (
            header[stepper.WORST_LATE] * 5 > header[stepper.LATEST] * 4
            or header[stepper.SHALLOWEST] < _SHALLOW_MS
        ):
            bits |= m.CONDITION_LOAD
        if self.rig.remember_positions:
            if self.journal is None or not self.journal.working:
                bits |= m.CONDITION_POSITIONS_UNSAVABLE
            else:
                bits |= (
                    m.CONDITION_POSITIONS_SAVED
                    if self.axes.positions.saved
                    else m.CONDITION_POSITIONS_PENDING
                )
        return bits

    def _condition(self):
        """MSG_CONDITION, framestep's own.

        The answer: CONDITION_ bits, then state and reason of each motor's position
        (motors/positions.py).
        """
        writer = self.writer
        positions = self.axes.positions
        writer.begin(m.MSG_CONDITION, self.reader)
        writer.u32(self.condition())
        for i in range(self.axes.count):
            writer.u8(positions.states[i])
            writer.u8(positions.reasons[i])
        writer.end()
        return 0

    def _load(self):
        """MSG_LOAD, framestep's own (field note 4.10): write m.Load, then reset its counts."""
        header = self.header
        writer = self.writer
        writer.begin(m.MSG_LOAD, self.reader)
        asked = header[stepper.ASKED]
        writer.u32(0 if asked < 0 else elapsed(self.now, asked))
        writer.u32(header[stepper.SPENT])
        writer.u32(header[stepper.PASSES])
        writer.u16(min(header[stepper.WORST_LATE], 0xFFFF))
        writer.u16(min(header[stepper.LATEST], 0xFFFF))
        writer.u16(header[stepper.SHALLOWEST])
        writer.end()
        header[stepper.ASKED] = self.now
        header[stepper.SPENT] = header[stepper.PASSES] = header[stepper.WORST_LATE] = 0
        header[stepper.SHALLOWEST] = stepper.UNSTRAINED
        return 0
