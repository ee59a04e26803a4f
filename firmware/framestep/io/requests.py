"""Requests that are about lights, outputs, inputs and the camera, and the one report of them.

The controller merges `handlers` into its own table; a handler returns the code to acknowledge
with, or 0 where it has answered itself. Nothing allocates after construction.
"""

from framestep.io.camera import Camera
from framestep.io.gio import Gio
from framestep.io.lights import Lights
from framestep.protocol import messages as m


class Io:
    """What a rig has beside its motors: `lights`, `gio`, `camera`."""

    def __init__(self, hal, rig, reader, writer):
        self.hal = hal
        self.reader = reader
        self.writer = writer
        self.now = 0
        self.lights = Lights(hal.dmx.channels, rig.dmx_ramp_ms)
        self.gio = Gio(hal, rig)
        self.camera = Camera(hal, rig)
        self.say_inputs = False  # GIO_IN is due
        self.handlers = {
            m.MSG_DMX: self._dmx,
            m.MSG_GIO_OUT: self._gio_out,
            m.MSG_GIO_IN: self._gio_in,
            m.MSG_GIO_CAM: self._gio_cam,
        }

    def poll(self, now, levels):
        """One pass; now: milliseconds modulo 2^30, levels: HAL.levels()."""
        self.now = now
        if self.gio.poll(now, levels):
            self.say_inputs = True
        self.camera.poll(now)
        self.lights.poll(now)
        self.hal.dmx.show(self.lights)

    def safe(self):
        """Outputs to their safe levels; lights stay as they are."""
        self.gio.safe()
        self.camera.safe()

    def report(self, is_open):
        """Send what is due, as far as there is room; with the port closed it is forgotten."""
        if self.say_inputs and (not is_open or self._send_inputs(None)):
            self.say_inputs = False

    def _send_inputs(self, reader):
        writer = self.writer
        writer.begin(m.MSG_GIO_IN, reader)
        writer.u32(self.gio.inputs.values)
        return writer.end()

    # ---------------------------------------------------------------- requests

    def _dmx(self):
        """spec: MSG_DMX. ramp 0, start channel 1, levels from 3 on."""
        reader = self.reader
        ramp = reader.u8(0)
        channel = reader.u16(1)
        count = reader.length - 3
        if ramp > 1 or not self.lights.fits(channel, count):
            return m.ERR_RANGE
        if ramp:
            self.lights.ramp(self.now, channel, reader.buffer, reader.payload + 3, count)
        else:
            self.lights.put(channel, reader.buffer, reader.payload + 3, count)
        return m.OK

    def _gio_out(self):
        # bits past the last output stand for nothing
        self.gio.put(0xFFFF, self.reader.u16(0))
        return m.OK

    def _gio_in(self):
        self._send_inputs(self.reader)
        return 0

    def _gio_cam(self):
        flags = self.reader.u16(0)
        self.camera.set(flags & m.GIO_CAM_SHUTTER, flags & m.GIO_CAM_METER)
        return m.OK
