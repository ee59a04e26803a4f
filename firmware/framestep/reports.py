"""Messages to the host: HI, positions, and everything that is sent unasked once there is room."""

from framestep.base.clock import elapsed
from framestep.protocol import messages as m

VERSION = (0, 1, 0)
CAPABILITIES = m.CAP_REALTIME | m.CAP_GO_MOTION | m.CAP_GO_MOTION2 | m.CAP_LOOP | m.CAP_COUPLE


class Reports:
    """Keeps what is due to be sent until the writer has room.

    Call join() before the first pass. Nothing allocates after construction.
    """

    def __init__(self, hal, rig, writer, axes, io):
        self.rig = rig
        self.writer = writer
        self.axes = axes
        self.io = io
        self.moves = None
        self.operations = None
        self.virtuals = None
        self.hi = False
        self.position = False
        self.frame = False  # `position` is for the frame reached last
        self.virtual = False
        self.end = False
        self.go = False
        # the reason of a hard stop, -1 for none
        self.hard_stop = m.HARD_STOP_FAULT if hal.watchdog.caused_reset else -1
        self.was_moving = False
        self.period_ms = rig.report_ms
        self.sent_at = 0  # time of the last positions, ms

    def join(self, moves, virtuals):
        """Set the parts on which it reports, which need a Reports themselves."""
        self.moves = moves
        self.operations = moves.operations
        self.virtuals = virtuals

    def report_hi(self):
        """Request HI, because the port was opened (field note 1.5)."""
        self.hi = True

    def report_positions(self):
        """Request a report of positions, because one was set."""
        self.position = True

    def report_frame(self):
        """Request a report of the frame that a run has just reached."""
        self.position = self.frame = True

    def report_go(self):
        """Request a report of a GO that came from an input."""
        self.go = True

    def report_fault(self):
        """Request a report of an internal fault to the host."""
        self.hard_stop = m.HARD_STOP_FAULT

    def on_closed(self):
        """Drop everything that is due, because the port is closed; but keep the reason of a stop
        for the next host."""
        self.hi = self.position = self.frame = self.virtual = self.end = self.go = False

    def send(self, now, listened):
        """Send what is due, as far as there is room (field notes 1.3 and 4.6).

        now: ms. listened: whether a host has the port open.
        """
        writer = self.writer
        if self.operations.rt_end_due:
            self.operations.end_reported()
            self.position = self.end = True
        moving = self.axes.moving
        if moving:
            if elapsed(now, self.sent_at) >= self.period_ms:
                self.position = True
        elif self.was_moving:
            self.position = True
        self.was_moving = moving
        self.io.report(listened)
        if not listened:
            self.on_closed()
            return
        if self.hi:
            self.send_hi(None)
        if self.hard_stop >= 0:
            writer.begin(m.MSG_MOTOR_HARD_STOP, None)
            writer.u8(self.hard_stop)
            if writer.end():
                self.hard_stop = -1
        virtuals = self.virtuals
        if self.virtual and (not virtuals.configured or virtuals.send_positions(None)):
            self.virtual = False  # field note 9.8
        if self.position and self.send_positions(None, self.frame):
            self.position = self.frame = False
            self.sent_at = now
            self.axes.hal.port.look_for_stop()
            self.virtual = virtuals.configured  # sent in the next pass, as they take some computing
        if self.go:
            writer.begin(m.MSG_RT_GO, None)
            if writer.end():
                self.go = False
        if self.end and not self.position and not self.go:
            writer.begin(m.MSG_RT_END, None)
            if writer.end():
                self.end = False

    def send_hi(self, reader):
        """Send HI: what the device is and what it has (field note 1.5).

        reader: has the request, or None; then it stays due until there is room.
        """
        writer = self.writer
        writer.begin(m.MSG_HI, reader)
        writer.text(self.rig.name, m.DeviceInfo.major)  # up to the next field
        writer.u8(VERSION[0])
        writer.u8(VERSION[1])
        writer.u8(VERSION[2])
        writer.u8(self.axes.count)
        writer.u16(self.io.lights.count)
        writer.u8(self.io.gio.outputs.count)
        writer.u8(self.io.gio.inputs.count)
        writer.u8(len(self.rig.limits))
        writer.u32(self.moves.upload_frames)
        camera = m.CAP_CAMERA if self.io.camera.there else 0
        writer.u32(CAPABILITIES | camera | self.virtuals.capabilities)
        writer.u16(m.PROTOCOL_VERSION)
        if writer.end():
            self.hi = False

    def send_positions(self, reader, frame=False):
        """Send MOTOR_GET_POSITION: MOVE TIME and positions at the same time on the pins.

        reader: has the request, or None. frame: send those of the frame reached last (field
        note 4.6). Return whether there was room.
        """
        writer = self.writer
        writer.begin(m.MSG_MOTOR_GET_POSITION, reader)
        writer.u32(self.operations.sample_move_time(frame))
        writer.put_i32s_from(self.axes.reported, 0, self.axes.count)
        return writer.end()
