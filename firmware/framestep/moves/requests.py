"""Requests about uploaded moves and what plays them.

The controller merges `handlers` into its own table; a handler returns the code to acknowledge with,
or 0 where it has answered itself. Here payloads are taken apart; what a request means is decided
in stage.py and the operations. Nothing allocates after construction.
"""

from array import array

from framestep.moves.cues import CueStore
from framestep.moves.follow import UNTOLD, WHAT
from framestep.moves.jog import JogAll
from framestep.moves.run import RunMove
from framestep.moves.shoot import ShootFrame
from framestep.moves.show import OUTPUTS, Show
from framestep.moves.stage import READY, Stage
from framestep.moves.store import UploadStore
from framestep.native import const
from framestep.protocol import messages as m

_BYTES_PER_CHANGE = const(140)  # of memory, 7 of which are for the change and its share of the triggers

RUN_FLAGS = m.RUN_PING_PONG | m.RUN_LOOP | m.RUN_VIDEO | m.RUN_STILLS


class Moves:
    """The uploaded move and everything that plays it. controller: for what is shared with other requests."""

    def __init__(self, controller):
        self.controller = controller
        self.reader = controller.reader
        axes = controller.axes
        self.cues = CueStore(0, 0)
        self.store = UploadStore(axes.count)
        self.stage = Stage(axes, self.store, controller.safety)
        self.show = Show(axes, controller.io, self.cues)
        self.run = RunMove(self.stage, self.show)
        self.shoot = ShootFrame(self.stage, self.show)
        self.jog = JogAll(self.stage)
        self.places = array("i", [0] * axes.count)
        self.handlers = {
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
        if controller.io.lights.count:
            self.handlers[m.MSG_RT_UPLOAD_MOVE_DMX] = self._dmx

    def take_memory(self):
        """The last thing at boot: lights and triggers get 5 % of the memory that is left, positions the rest."""
        changes = self.controller.hal.upload_bytes // _BYTES_PER_CHANGE
        self.cues.take(changes, changes // 8)
        self.store.take(self.controller.hal.upload_bytes)

    @property
    def upload_frames(self):
        """How many frames can be uploaded for all motors."""
        return self.store.capacity_frames(self.store.motors)

    def poll(self):
        """Every few milliseconds: what is due, and what is to be planned. Whether there may be more to plan at once."""
        if self.show.busy:
            self.show.poll()
        if self.stage.state == READY and self.controller.virtuals.engaged:
            return False  # its motors are not at rest, whether they move or not
        return self.stage.poll()

    # ---------------------------------------------------------------- uploads

    def _begin(self):
        """spec: MSG_RT_UPLOAD_MOVE_BEGIN. start 0, end 4."""
        if self.stage.running:
            return m.ERR_MOVING
        code = self.store.begin(self.reader.i32(0), self.reader.i32(4))
        if code == m.OK:
            self.cues.begin(self.store.end - self.store.start + 1)
            self.stage.drop()
        return code

    def _axis(self):
        """spec: MSG_RT_UPLOAD_MOVE_AXIS. motor 0, start index 1 (high bit: the last), positions from 5 on."""
        reader = self.reader
        number = reader.u8(0)
        if number < 1 or number > self.stage.axes.count:
            return m.ERR_RANGE
        if self.stage.running:
            return m.ERR_MOVING
        last = reader.u8(4) & 0x80
        return self.store.section(number - 1, reader.start_index(1), last, reader, 5, (reader.length - 5) >> 2)

    def _dmx(self):
        """spec: MSG_RT_UPLOAD_MOVE_DMX. channel 0, start index 2 (high bit: the last), levels from 6 on."""
        reader = self.reader
        if self.stage.running:
            return m.ERR_MOVING
        last = reader.u8(5) & 0x80
        return self.cues.levels(reader.u16(0), reader.start_index(2), last, reader, 6, reader.length - 6)

    def _triggers(self):
        """spec: MSG_RT_UPLOAD_MOVE_TRIGGERS. mask 0, then pairs of frame and values."""
        if self.stage.running:
            return m.ERR_MOVING
        return self.cues.triggers(self.reader, 4, (self.reader.length - 4) >> 3)

    def _end(self):
        if self.stage.running:
            return m.ERR_MOVING
        code = self.store.finish()
        if code == m.OK:
            self.cues.finish()
        return code

    # ---------------------------------------------------------------- operations

    def _position_frame(self):
        code = self.controller.motors.may_move_all()
        if code == m.OK and (self.stage.running or self.controller.virtuals.engaged):
            code = m.ERR_MOVING
        if code == m.OK:
            code = self.stage.go_to_frame(self.reader.i32(0), self.places)
        if code == m.OK:
            self.controller.motors.moving_all(self.stage.follower.motors())
            self.show.place(self.reader.i32(0) - self.store.start)
        return code

    def _run_move(self):
        """spec: MSG_RT_RUN_MOVE. fps 0, start 4, end 8, pre-roll 12, post-roll 16, sync 20, bloop outputs
        21, channel 25, time 27, flags 29, open and close angle 31 and 33."""
        reader = self.reader
        code = self._may_begin()
        if code != m.OK:
            return code
        flags = reader.u16(29) if reader.length >= m.RUN_FLAGS_BYTES else 0
        channel = reader.u16(25)
        if reader.u8(20) > 1 or channel > 512 or flags & ~RUN_FLAGS:
            return m.ERR_RANGE
        if flags & m.RUN_STILLS:
            flags &= ~m.RUN_VIDEO  # field note 6.9
        plan = self.run.draft
        plan.sync = reader.u8(20) == 1
        plan.bloop_bits = reader.u16(21) | (reader.u16(23) & OUTPUTS >> 16) << 16
        plan.bloop_channel = channel
        plan.bloop_ms = reader.u16(27)
        opened = closed = 0
        if flags & m.RUN_STILLS and reader.length >= m.RUN_ANGLES_BYTES:
            opened = reader.u16(31)
            closed = reader.u16(33)
        code = self.run.prepare(
            reader.count(0),
            reader.i32(4),
            reader.i32(8),
            reader.count(12),
            reader.count(16),
            flags,
            opened,
            closed,
        )
        if code == m.OK:
            self.controller.motors.moving_all(self.run.bits)
        return self._tell(code)

    def _tell(self, code):
        """Have the REPL told that the move asks too much of a motor (field note 5.5)."""
        if self.stage.follower.exceeded[WHAT]:
            self.controller.untold |= UNTOLD
        return code

    def _shoot_frame(self):
        """spec: MSG_RT_SHOOT_FRAME. frame 0, direction 4, exposure 5, blur 9, motors from 11 on."""
        reader = self.reader
        code = self._may_begin()
        if code == m.OK and reader.u8(4) > 1:
            code = m.ERR_RANGE
        if code == m.OK:
            code = self.shoot.blur(reader.i32(0), reader.u8(4) == 0, reader.count(5), reader.u16(9), reader)
        if code == m.OK:
            self.controller.motors.moving_all(self.shoot.bits)
        return code

    def _shoot_frame2(self):
        """spec: MSG_RT_SHOOT_FRAME2. frame 0, exposure 4, open 8, close 10, motors from 12 on."""
        reader = self.reader
        code = self._may_begin()
        if code == m.OK:
            code = self.shoot.angles(reader.i32(0), reader.count(4), reader.i16(8), reader.i16(10), reader)
        if code == m.OK:
            self.controller.motors.moving_all(self.shoot.bits)
        return code

    def _may_begin(self):
        """OK where an operation may be prepared (field note 6.1)."""
        code = self.controller.motors.may_move_all()
        if code == m.OK:
            if self.stage.running or self.stage.axes.moving or self.controller.virtuals.engaged:
                return m.ERR_MOVING
            self.stage.follower.exceeded[WHAT] = m.EXCEEDED_NOTHING
        return code

    def _may_go(self):
        code = self.controller.motors.may_move_all()
        if code == m.OK:
            code = self.stage.may_go()
        if code == m.OK and self.stage.operation.bits & self.controller.virtuals.engaged:
            code = m.ERR_NOT_IN_POSITION  # they are about to leave
        return code

    def _go(self):
        code = self._may_go()
        if code == m.OK:
            # field note 6.3: acknowledged first, then motion starts
            self.controller.acknowledge(m.OK)
            self.stage.go()
            return 0
        return code

    def go_from_input(self):
        """The setting `go_input` (field note 6.13): GO where GO would be OK. Whether it was."""
        if self._may_go() != m.OK:
            return False
        self.stage.go()
        return True

    def _stop_loop(self):
        """spec: MSG_RT_STOP_LOOP. Before GO as well; without a loop it is nothing to do (field note 6.12)."""
        if self.stage.busy and self.stage.operation is self.run:
            self.run.stop_loop()
        return m.OK

    def _jog_all(self):
        """spec: MSG_RT_JOG_ALL. fps 0, destination 4."""
        code = self.controller.motors.may_move_all()
        if code == m.OK and not self.stage.running and self.controller.virtuals.engaged:
            code = m.ERR_MOVING
        if code == m.OK:
            code = self.jog.request(self.reader.count(0), self.reader.i32(4))
        if code == m.OK:
            self.controller.motors.moving_all(self.jog.bits)
        return self._tell(code)
