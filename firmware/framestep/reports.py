"""What the host is told: HI, positions, and all that is sent unasked as soon as there is room for
it."""

from framestep.base.clock import elapsed
from framestep.protocol import messages as m
from framestep.pulse import stepper

VERSION = (0, 1, 0)
CAPABILITIES = (
    m.CAP_REALTIME | m.CAP_GO_MOTION | m.CAP_GO_MOTION2 | m.CAP_LOOP | m.CAP_CAMERA | m.CAP_COUPLE
)


class Reports:
    """Keeps what is due to be sent until the writer has room.

    controller: for what is reported. Nothing allocates after construction.
    """

    def __init__(self, controller):
        self.controller = controller
        self.writer = controller.writer
        self.hi = False
        self.position = False
        self.frame = False  # `position` is that of the frame reached last
        self.virtual = False
        self.end = False
        self.go = False
        # the reason of a hard stop, -1 for none
        self.hard_stop = m.HARD_STOP_FAULT if controller.hal.watchdog.caused_reset else -1
        self.was_moving = False
        self.period_ms = controller.rig.report_ms
        self.sent_at = 0  # when positions were, ms

    def nobody_listens(self):
        """The port is closed: drop all but what stopped the motors, which the next host gets."""
        self.hi = self.position = self.frame = self.virtual = self.end = self.go = False

    def send(self):
        """Send what is due, as far as there is room (field notes 1.3 and 4.6)."""
        controller = self.controller
        writer = self.writer
        moving = stepper.moving(controller.header) != 0
        if moving:
            if elapsed(controller.now, self.sent_at) >= self.period_ms:
                self.position = True
        elif self.was_moving:
            self.position = True
        self.was_moving = moving
        operations = controller.operations
        if operations.rt_end_due:
            operations.rt_end_due = False
            self.position = self.end = True
        listened = controller.was_open
        controller.io.report(listened)
        if not listened:
            self.nobody_listens()
            return
        if self.hi and self.send_hi(None):
            self.hi = False
        if self.hard_stop >= 0:
            writer.begin(m.MSG_MOTOR_HARD_STOP, None)
            writer.u8(self.hard_stop)
            if writer.end():
                self.hard_stop = -1
        virtuals = controller.virtuals
        if self.virtual and (not virtuals.configured or virtuals.send_positions(None)):
            self.virtual = False  # field note 9.8
        if self.position and self.send_positions(None, self.frame):
            self.position = self.frame = False
            self.sent_at = controller.now
            self.virtual = virtuals.configured  # in the next pass, as they take some computing
        if self.go:
            writer.begin(m.MSG_RT_GO, None)
            if writer.end():
                self.go = False
        if self.end and not self.position and not self.go:
            writer.begin(m.MSG_RT_END, None)
            if writer.end():
                self.end = False

    def send_hi(self, reader):
        """Send HI: what the device is and has (field note 1.5).

        reader: of the request, or None. Returns whether there was room.
        """
        controller = self.controller
        writer = self.writer
        writer.begin(m.MSG_HI, reader)
        writer.text(controller.rig.name, m.DeviceInfo.major)  # up to the next field
        writer.u8(VERSION[0])
        writer.u8(VERSION[1])
        writer.u8(VERSION[2])
        writer.u8(controller.count)
        writer.u16(controller.io.lights.count)
        writer.u8(controller.io.gio.outputs.count)
        writer.u8(controller.io.gio.inputs.count)
        writer.u8(len(controller.rig.limits))
        writer.u32(controller.moves.upload_frames)
        writer.u32(CAPABILITIES | controller.virtuals.capabilities)
        writer.u16(m.PROTOCOL_VERSION)
        return writer.end()

    def send_positions(self, reader, frame=False):
        """Send MOTOR_GET_POSITION: MOVE TIME and positions, at the same time on the pins.

        reader: of the request, or None. frame: those of the frame reached last (field note 4.6).
        Returns whether there was room.
        """
        controller = self.controller
        writer = self.writer
        writer.begin(m.MSG_MOTOR_GET_POSITION, reader)
        writer.u32(controller.operations.sample_move_time(frame))
        writer.put_i32s_from(controller.axes.reported, 0, controller.count)
        return writer.end()
