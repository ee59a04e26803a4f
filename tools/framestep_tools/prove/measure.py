"""A whole measurement, one figure of figures.py after another."""

from contextlib import suppress

from ..client.client import RequestRefused
from ..payloads import MotorMove, MotorSetSpeed
from .check import check
from .collector import STEEPEST, WRAP_US, named
from .pins import FASTEST_HZ, STEADY_HZ, Pins
from .processor import Processor

RUNS = {"frame_us_23976": 23_976, "frame_us_24": 24_000, "frame_us_60": 60_000}


class Measuring(Pins, Processor):
    """A whole measurement."""

    def everything(self) -> dict[str, float]:
        """Measure everything, and bring the motors back to their start.

        Raises ToolError, before anything moves, if something would keep a motor from moving.
        """
        layout = self.board.layout
        self._began_at = self._positions()
        check(self.client, layout.measured, self._began_at)
        begun = self._clocks()
        self.figures["upload_frames"] = self.board.info.upload_frames
        self.figures["heap_bytes"] = self.board.free_bytes
        for motor, why in layout.left_out.items():
            self._say(f"motor {motor} is left out: it {why}")
        groups = layout.groups[: 1 if self._short else None]
        for motors in groups:
            self._say(f"{named(motors)} at 350 000 steps/s")
            self._steady(motors, STEADY_HZ, "rate_350k", "edge_350k_us")
        self._together()
        last = layout.measured[-1:]
        self._say(f"{named(last)} at 500 000 steps/s")
        self._steady(last, FASTEST_HZ, "rate_500k", "edge_500k_us")
        for motors in groups:
            self._say(f"turns, retargets and a hard stop of {named(motors[:2])}")
            self._turns(motors[:2])
        for key, fps_milli in list(RUNS.items())[: 1 if self._short else None]:
            for motors in groups:
                self._say(f"a run of {named(motors)} at {fps_milli / 1000} fps")
                self._run_frames(motors, fps_milli, key)
        self._say("DMX, answers, an upload, the interrupt")
        self._dmx()
        self._replies()
        self._upload()
        self._passes()
        self._tick(layout.groups[0], "tick_us", "tick_us_most")
        self._tick(layout.measured, "tick_all_us", "tick_all_us_most")
        self._flash()
        self._go_back()
        ended = self._clocks()
        host, own = ended[0] - begun[0], (ended[1] - begun[1]) % WRAP_US
        self.figures["clock_ppm"] = own / host - 1e6
        return self.figures

    def _go_back(self) -> None:
        """Bring every motor back to its start, fast if its pulses allow it."""
        for motor in self.board.layout.measured:
            with suppress(RequestRefused):
                self.client.request(MotorSetSpeed(motor, STEADY_HZ, STEEPEST))
            self.client.request(MotorMove(motor, self._began_at[motor - 1]))
        self.client.wait_idle()
