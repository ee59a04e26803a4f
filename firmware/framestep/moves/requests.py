"""Requests about uploaded moves and the operations that play them.

Their handlers are added to the link's. A handler returns the code to acknowledge with,
or 0 if it has answered itself. Within moves, only this module reads payloads. What a request means
is decided in operation_runner.py and by the operations. Nothing allocates after construction.
"""

from array import array

from framestep.base.native import const
from framestep.base.results import BY, FRAME, MOTOR, ROOM, WHAT
from framestep.moves.jog import JogAll
from framestep.moves.operation_runner import READY, OperationRunner
from framestep.moves.path.move_check import UNREPORTED
from framestep.moves.run import RunMove
from framestep.moves.run_outputs import OUTPUTS, RunOutputs
from framestep.moves.shoot import EXPOSURE, ShootFrame
from framestep.moves.upload.chunks import ASKED, LEFT
from framestep.moves.upload.light_levels import LightLevels
from framestep.moves.upload.store import UploadStore
from framestep.moves.upload.triggers import Triggers
from framestep.protocol import messages as m

_RUN_FLAGS = const(m.RUN_PING_PONG | m.RUN_LOOP | m.RUN_VIDEO | m.RUN_STILLS)


class Moves:
    """Handlers of requests about the uploaded move, and the parts that play it.

    interlock: an Interlock. faults: a FaultLog.
    """

    def __init__(self, rig, link, axes, io, interlock, faults):
        self.link = link
        self.reader = link.reader
        self.interlock = interlock
        self.faults = faults
        self.axes = axes
        self.levels = LightLevels()
        self.triggers = Triggers()
        self.store = UploadStore(axes.count)
        self.operations = OperationRunner(
            axes, self.store, io.safety, interlock.prepare, rig.strict_moves
        )
        self.player = self.operations.player
        if rig.smoothing:
            from framestep.moves.path.smoothing import velocity

            self.player.smooth(velocity)
        self.run_outputs = RunOutputs(axes, io, self.levels, self.triggers)
        self.run = RunMove(self.operations, self.run_outputs)
        self.shoot = ShootFrame(self.operations, self.run_outputs)
        self.jog = JogAll(self.operations)
        self.positions = array("i", [0] * axes.count)
        link.handlers.update(
            {
                m.MSG_RT_UPLOAD_MOVE_BEGIN: self._begin,
                m.MSG_RT_UPLOAD_MOVE_AXIS: self._axis,
                m.MSG_RT_UPLOAD_MOVE_TRIGGERS: self._triggers,
                m.MSG_RT_UPLOAD_MOVE_END: self._end,
                m.MSG_RT_POSITION_FRAME: self._position_frame,
                m.MSG_RT_RUN_MOVE: self._run_move,
                m.MSG_RT_SHOOT_FRAME: self._shoot_frame,
                m.MSG_RT_SHOOT_FRAME2: self._shoot_frame2,
                m.MSG_RT_GO: self._go,
                m.MSG_RT_STOP_LOOP: self._stop_loop,
                m.MSG_RT_JOG_ALL: self._jog_all,
            }
        )
        if io.lights.count:
            link.handlers[m.MSG_RT_UPLOAD_MOVE_DMX] = self._dmx

    def take_memory(self):
        """Allocate the memory for positions, light levels and triggers, at the end of boot."""
        self.store.allocate(self.axes.hal.upload_bytes)
        self.levels.allocate(self.store)
        self.triggers.allocate(self.store)

    @property
    def upload_frames(self):
        """How many frames fit if all motors have data."""
        return self.store.capacity_frames(self.store.motors)

    def set_motors(self, blurred, excluded):
        """Set the bits of motors that move in SHOOT_FRAME, and of motors left out of moves."""
        self.shoot.blurred = blurred
        self.player.excluded = excluded

    def poll(self):
        """Do what is due, and a piece of planning. To be called every few milliseconds.

        Return whether there may be more to plan.
        """
        if self.run_outputs.busy:
            self.run_outputs.poll()
        if self.operations.state == READY and self.interlock.in_virtual_motion:
            return False  # its motors belong to a virtual motion, whether they move or not
        return self.operations.poll()

    # ---------------------------------------------------------------- uploads

    def _begin(self):
        """MSG_RT_UPLOAD_MOVE_BEGIN (field notes 5.1 and 5.3)."""
        if self.operations.running:
            return m.ERR_MOVING
        code = self.store.begin(
            self.reader.i32(m.RtUploadMoveBegin.start_frame),
            self.reader.i32(m.RtUploadMoveBegin.end_frame),
        )
        if code == m.OK:
            frames = self.store.end - self.store.start + 1
            self.levels.begin(frames)
            self.triggers.begin(frames)
            self.operations.drop_prepared()
            self.shoot.request[EXPOSURE] = 0
            self.operations.exceeded[WHAT] = m.EXCEEDED_NOTHING
        return code

    def _axis(self):
        """MSG_RT_UPLOAD_MOVE_AXIS (field note 5.3); the start index has a bit: last section."""
        reader = self.reader
        number = reader.u8(m.RtUploadMoveAxis.motor)
        if number < 1 or number > self.axes.count:
            return m.ERR_RANGE
        if self.operations.running:
            return m.ERR_MOVING
        code = self.store.section(
            number - 1,
            reader.start_index(m.RtUploadMoveAxis.start_index),
            reader.u8(m.RtUploadMoveAxis.start_index + 3) & 0x80,
            reader.buffer,
            reader.payload + m.RtUploadMoveAxis.positions,
            (reader.length - m.RtUploadMoveAxis.positions) >> 2,
        )
        return code if code == m.OK else self._exceeded(code)

    def _dmx(self):
        """MSG_RT_UPLOAD_MOVE_DMX (field note 5.3), similarly."""
        reader = self.reader
        if self.operations.running:
            return m.ERR_MOVING
        code = self.levels.store(
            reader.u16(m.RtUploadMoveDmx.channel),
            reader.start_index(m.RtUploadMoveDmx.start_index),
            reader.u8(m.RtUploadMoveDmx.start_index + 3) & 0x80,
            reader.buffer,
            reader.payload + m.RtUploadMoveDmx.levels,
            reader.length - m.RtUploadMoveDmx.levels,
        )
        return code if code == m.OK else self._exceeded(code)

    def _triggers(self):
        """MSG_RT_UPLOAD_MOVE_TRIGGERS (field note 5.3)."""
        if self.operations.running:
            return m.ERR_MOVING
        reader = self.reader
        reader.copy_i32_to(m.RtUploadMoveTriggers.mask, self.positions, 0)
        code = self.triggers.store(
            self.positions,
            reader.buffer,
            reader.payload + m.RtUploadMoveTriggers.triggers,
            (reader.length - m.RtUploadMoveTriggers.triggers) >> 3,
        )
        return code if code == m.OK else self._exceeded(code)

    def _end(self):
        """MSG_RT_UPLOAD_MOVE_END: the move can then be played (field note 5.3)."""
        if self.operations.running:
            return m.ERR_MOVING
        code = self.store.finish()
        if code == m.OK:
            self.levels.finish()
            self.triggers.finish()
        return code if code == m.OK else self._exceeded(code)

    # ---------------------------------------------------------------- operations

    def _position_frame(self):
        """MSG_RT_POSITION_FRAME (field notes 4.6, 5.1 and 6.11).

        Moves the motors there, and sets lights and triggers as at that frame.
        """
        frame = self.reader.i32(m.RtPositionFrame.frame)
        code = self.interlock.may_move_all()
        if code == m.OK and (self.operations.running or self.interlock.in_virtual_motion):
            code = m.ERR_MOVING
        if code == m.OK:
            code = self.operations.send_to_frame(frame, self.positions)
        if code == m.OK:
            self.run_outputs.show_frame(frame - self.store.start)
        return code

    def _run_move(self):
        """MSG_RT_RUN_MOVE: move the motors to where the run begins, to wait for GO (field notes 6.1
        to 6.9)."""
        reader = self.reader
        code = self.may_begin()
        if code != m.OK:
            return code
        flags = reader.u16(m.RtRunMove.flags) if reader.length >= m.RtRunMove.open_angle else 0
        channel = reader.u16(m.RtRunMove.bloop_channel)
        sync = reader.u8(m.RtRunMove.sync_dmx)
        if sync > 1 or channel > 512 or flags & ~_RUN_FLAGS:
            return m.ERR_RANGE
        if flags & (m.RUN_VIDEO | m.RUN_STILLS) and not self.run_outputs.camera.there:
            return m.ERR_UNSUPPORTED
        plan = self.run.draft
        plan.loops = flags & m.RUN_LOOP != 0
        plan.turns = flags & m.RUN_PING_PONG != 0
        plan.stills = flags & m.RUN_STILLS != 0
        plan.video = flags & m.RUN_VIDEO != 0 and not plan.stills  # field note 6.9
        plan.sync = sync == 1
        plan.bloop_bits = reader.u16(m.RtRunMove.bloop_outputs) | (
            (reader.u16(m.RtRunMove.bloop_outputs + 2) & (OUTPUTS >> 16)) << 16
        )
        plan.bloop_channel = channel
        plan.bloop_ms = reader.u16(m.RtRunMove.bloop_ms)
        opened = closed = 0
        if plan.stills and reader.length >= m.RtRunMove.SIZE:
            opened = reader.u16(m.RtRunMove.open_angle)
            closed = reader.u16(m.RtRunMove.close_angle)
        code = self.run.prepare(
            reader.u30(m.RtRunMove.fps_milli),
            reader.i32(m.RtRunMove.start_frame),
            reader.i32(m.RtRunMove.end_frame),
            reader.u30(m.RtRunMove.preroll_ms),
            reader.u30(m.RtRunMove.postroll_ms),
            opened,
            closed,
        )
        if code == m.OK:
            self.interlock.prepare(self.run.bits)
        return self.report_exceeded(code)

    def _exceeded(self, code):
        """Keep what exceeds the memory, and report it on the REPL once for an upload (field note
        5.7). Return `code`."""
        words = self.store.words
        if words[ASKED]:
            exceeded = self.operations.exceeded
            if exceeded[WHAT] != m.EXCEEDED_MEMORY:
                exceeded[WHAT] = m.EXCEEDED_MEMORY
                self.report_exceeded(code)
            exceeded[MOTOR] = exceeded[FRAME] = 0
            exceeded[BY] = words[ASKED]
            exceeded[ROOM] = words[LEFT]
            words[ASKED] = 0
        return code

    def report_exceeded(self, code):
        """Report on the REPL if the move exceeds what a motor can do (field note 5.5).

        Return `code`.
        """
        if self.operations.exceeded[WHAT]:
            self.faults.note(0, UNREPORTED)
        return code

    def _shoot_frame(self):
        """MSG_RT_SHOOT_FRAME: direction 1 forward, 0 backward (field note 7.1)."""
        reader = self.reader
        code = self.may_begin()
        if code == m.OK and reader.u8(m.RtShootFrame.direction) > 1:
            code = m.ERR_RANGE
        if code == m.OK:
            backward = reader.u8(m.RtShootFrame.direction) == 0
            listed = self._listed(m.RtShootFrame.motors, backward)
            code = self.shoot.prepare_blur(
                reader.i32(m.RtShootFrame.frame),
                backward,
                reader.u30(m.RtShootFrame.exposure_ms),
                reader.u16(m.RtShootFrame.blur),
                listed,
            )
        if code == m.OK:
            self.interlock.prepare(self.shoot.bits)
        return self.report_exceeded(code)

    def _shoot_frame2(self):
        """MSG_RT_SHOOT_FRAME2 (field note 7.3)."""
        reader = self.reader
        code = self.may_begin()
        if code == m.OK:
            listed = self._listed(m.RtShootFrame2.motors, False)
            code = self.shoot.prepare_angles(
                reader.i32(m.RtShootFrame2.frame),
                reader.u30(m.RtShootFrame2.exposure_ms),
                reader.i16(m.RtShootFrame2.open_angle),
                reader.i16(m.RtShootFrame2.close_angle),
                listed,
            )
        if code == m.OK:
            self.interlock.prepare(self.shoot.bits)
        return self.report_exceeded(code)

    def _listed(self, offset, backward):
        """Put POS A and POS B of the motors listed at `offset` into the draft, swapped if
        `backward`.

        Return the bits of these motors, or -1 if one of them does not exist.
        """
        reader = self.reader
        draft = self.shoot.draft
        first = draft.b if backward else draft.a
        last = draft.a if backward else draft.b
        bits = 0
        while offset < reader.length:
            number = reader.u8(offset + m.BlurMotor.motor)
            if number < 1 or number > self.axes.count:
                return -1
            bits |= 1 << (number - 1)
            reader.copy_i32_to(offset + m.BlurMotor.position_a, first, number - 1)
            reader.copy_i32_to(offset + m.BlurMotor.position_b, last, number - 1)
            offset += m.BlurMotor.SIZE
        return bits

    def may_begin(self):
        """Return OK if an operation may be prepared, else the reason (field note 6.1)."""
        code = self.interlock.may_move_all()
        if code == m.OK:
            if self.operations.running or self.axes.moving or self.interlock.in_virtual_motion:
                return m.ERR_MOVING
            self.operations.exceeded[WHAT] = m.EXCEEDED_NOTHING
        return code

    def _may_go(self):
        """Return OK if the waiting operation may start, else the reason."""
        code = self.interlock.may_move_all()
        return self.operations.may_go(self.interlock.in_virtual_motion) if code == m.OK else code

    def _go(self):
        """MSG_RT_GO (field note 6.3). The acknowledgement goes out after the start, but before the
        first pulse, which comes milliseconds later, and before all messages about the motion."""
        code = self._may_go()
        if code == m.OK:
            self.operations.start()
        return code

    def go_from_input(self):
        """Give GO from an input (setting `go_input`, field note 6.13).

        Return whether the request would have been OK.
        """
        if self._may_go() != m.OK:
            return False
        self.operations.start()
        return True

    def _stop_loop(self):
        """MSG_RT_STOP_LOOP.

        It is valid before GO, too; without a loop it does nothing (field note 6.12).
        """
        if self.operations.busy and self.operations.operation is self.run:
            self.run.stop_loop()
        return m.OK

    def _jog_all(self):
        """MSG_RT_JOG_ALL (field note 6.10)."""
        code = self.interlock.may_move_all()
        if code == m.OK and not self.operations.running and self.interlock.in_virtual_motion:
            code = m.ERR_MOVING
        if code == m.OK:
            code = self.jog.prepare(
                self.reader.u30(m.RtJogAll.fps_milli), self.reader.i32(m.RtJogAll.destination)
            )
        if code == m.OK:
            self.interlock.prepare(self.jog.bits)
        return self.report_exceeded(code)
