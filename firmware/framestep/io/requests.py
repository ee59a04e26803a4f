"""Requests about lights, outputs, inputs and the camera, and reports of inputs and stop inputs.

Their handlers are added to the link's. A handler returns the code to acknowledge with,
or 0 if it has answered itself. Nothing allocates after construction.
"""

from array import array

from framestep.base.native import addressof, as_word, const, micropython, ptr32
from framestep.hal import CHANGED
from framestep.io.camera import Camera
from framestep.io.gio import ALL_INPUTS, RAW, STABLE, Gio
from framestep.io.lights import RAMPING, Lights
from framestep.io.safety import ACTIVE, CAUGHT, ESTOP, LOWER, REST, SWITCHES
from framestep.protocol import messages as m

# Work of a pass, found from words of Safety, Inputs and Lights
_SWITCHES = const(1)
_INPUTS = const(2)
_RAMPS = const(4)
_LEVELS = const(8)
# Bits of poll()
NEWS = const(_SWITCHES | _INPUTS)  # a switch or an input has changed
STOP = const(32)  # a stop input has become active
GO = const(64)  # the input for GO has gone on
SHOOT = const(128)  # the input that shoots a frame has gone on


@micropython.viper
def _due(table: ptr32, levels: int) -> int:
    """Return the work of this pass. table: addresses of the words."""
    switches = ptr32(table[0])
    inputs = ptr32(table[1])
    lights = ptr32(table[2])
    due = 0
    if ((levels ^ switches[REST]) & switches[SWITCHES]) | switches[ACTIVE] | switches[CAUGHT]:
        due = _SWITCHES
    if ((levels ^ inputs[STABLE]) | (levels ^ inputs[RAW])) & inputs[ALL_INPUTS]:
        due |= _INPUTS
    if lights[RAMPING]:
        due |= _RAMPS | _LEVELS
    elif lights[CHANGED]:
        due |= _LEVELS
    return due


def send_stops(writer, safety, is_open):
    """Send MSG_MOTOR_HARD_STOP for each stop input that has acted, as far as there is room.

    See field note 8.4. While the port is closed limits are not reported; the E-stop waits for a
    host.
    """
    if not is_open:
        safety.drop_limit_reports()
        return
    what = safety.unreported()
    while what >= 0:
        writer.begin(m.MSG_MOTOR_HARD_STOP, None)
        if what == ESTOP:
            writer.u8(m.HARD_STOP_GENERAL)
        elif what < LOWER:
            writer.u8(m.HARD_STOP_UPPER)
            writer.u8(what + 1)
        else:
            writer.u8(m.HARD_STOP_LOWER)
            writer.u8(what - LOWER + 1)
        if not writer.end():
            return
        safety.reported(what)
        what = safety.unreported()


class Io:
    """The parts of a rig besides motors: `lights`, `gio`, `camera`, the stop inputs of `safety`."""

    def __init__(self, hal, rig, link, safety):
        self.safety = safety
        self.hal = hal
        self.reader = link.reader
        self.writer = link.writer
        self.now = 0
        self._read_levels = hal.levels
        self.lights = Lights(hal.dmx.channels, rig.dmx_ramp_ms)
        self.gio = Gio(hal, rig)
        self.camera = Camera(hal, rig)
        tables = (safety.words, self.gio.inputs.words, self.lights.words)
        self._table = array("i", [as_word(addressof(words)) for words in tables])
        self.inputs_due = False  # GIO_IN is due
        self._go_bit = 1 << (rig.go_input - 1) if rig.go_input else 0
        self._shoot_bit = 1 << (rig.shoot_input - 1) if rig.shoot_input else 0
        self._buttons = self._go_bit | self._shoot_bit
        self._were_on = self.gio.inputs.values & self._buttons
        link.handlers.update(
            {
                m.MSG_GIO_OUT: self._gio_out,
                m.MSG_GIO_IN: self._gio_in,
            }
        )
        if self.camera.there:
            link.handlers[m.MSG_GIO_CAM] = self._gio_cam
        if self.lights.count:
            link.handlers[m.MSG_DMX] = self._dmx

    def poll(self, now):
        """Do one pass. now: milliseconds modulo 2^29. Return bits of NEWS, STOP, GO and
        SHOOT."""
        self.now = now
        levels = self._read_levels()
        due = _due(self._table, levels)
        if due == 0:
            return 0
        news = due & NEWS
        if due & _INPUTS and self.gio.poll(now, levels):
            self.inputs_due = True
            if self._buttons:
                pressed = ~self._were_on
                self._were_on = self.gio.inputs.values & self._buttons
                pressed &= self._were_on
                if pressed & self._go_bit:
                    news |= GO
                if pressed & self._shoot_bit:
                    news |= SHOOT
        if due & _RAMPS:
            self.lights.poll(now)
        if due & _LEVELS:
            self.hal.dmx.show(self.lights)
        if due & _SWITCHES and self.safety.poll(now, levels):
            news |= STOP
        return news

    def safe(self):
        """Set the outputs to their safe levels. Lights stay as they are."""
        self.gio.safe()
        self.camera.safe()

    def report(self, is_open):
        """Send what is due, as far as there is room. While the port is closed it is dropped."""
        send_stops(self.writer, self.safety, is_open)
        if self.inputs_due and (not is_open or self._send_inputs(None)):
            self.inputs_due = False

    def _send_inputs(self, reader):
        """Send GIO_IN: inputs from bit 0 on, 1 for on. Return whether there was room."""
        writer = self.writer
        writer.begin(m.MSG_GIO_IN, reader)
        writer.u32(self.gio.inputs.values)
        return writer.end()

    # ---------------------------------------------------------------- requests

    def _dmx(self):
        """MSG_DMX: levels from a channel on; `ramp` is 0 or 1 (field note 8.1)."""
        reader = self.reader
        ramp = reader.u8(m.Dmx.ramp)
        channel = reader.u16(m.Dmx.channel)
        levels = reader.payload + m.Dmx.levels
        count = reader.length - m.Dmx.levels
        if ramp > 1 or not self.lights.fits(channel, count):
            return m.ERR_RANGE
        if ramp:
            self.lights.ramp(self.now, channel, reader.buffer, levels, count)
        else:
            self.lights.put(channel, reader.buffer, levels, count)
        return m.OK

    def _gio_out(self):
        """MSG_GIO_OUT: one bit each, 1 for on (field note 8.3).

        Bits beyond the last output are ignored.
        """
        self.gio.put(0xFFFF, self.reader.u16(m.GioOut.outputs))
        return m.OK

    def _gio_in(self):
        """MSG_GIO_IN: answer with the inputs that are on (field note 8.3)."""
        self._send_inputs(self.reader)
        return 0

    def _gio_cam(self):
        """MSG_GIO_CAM: bits GIO_CAM_, 1 for on (spec)."""
        flags = self.reader.u16(m.GioCam.flags)
        self.camera.set(flags & m.GIO_CAM_SHUTTER, flags & m.GIO_CAM_METER)
        return m.OK
