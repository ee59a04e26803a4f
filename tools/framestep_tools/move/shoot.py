"""`framestep shoot`: shoot frames one by one with the motors in motion."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from framestep.moves.upload.store import FARTHEST_FRAME

from ..client.client import Client
from ..client.state import Stopped, is_stopped, why_stopped
from ..errors import USAGE, ToolError
from ..payloads import BlurMotor, RtEnd, RtGo, RtPositionFrame, RtShootFrame2
from .half_frame import ends
from .move_display import ShotDisplay
from .move_file import Move

_ENDLESS = float("inf")
_FULL_TURN = 360
_LATE_S = 0.05
_MOST_FRAMES = 100_000
_RANGE = re.compile(r"(?P<first>-?\d{1,9})(?:-(?P<last>-?\d{1,9}))?")


class FramesError(ToolError):
    """Text is not a list of frames, or has too many."""

    status = USAGE


def frames_of(texts: Sequence[str]) -> list[int]:
    """Parse scene frames such as 7, 1-48, 48-1 (backward) and 1-5,9. Raises FramesError."""
    found: list[int] = []
    for text in ",".join(texts).split(","):
        match = _RANGE.fullmatch(text.strip())
        if not match:
            raise FramesError(
                f"expected frames such as 7, 1-48 or 1-5,9, found {text.strip()[:40]!r}"
            )
        first = int(match["first"])
        last = first if match["last"] is None else int(match["last"])
        if max(abs(first), abs(last)) > FARTHEST_FRAME:
            raise FramesError(
                f"frames have numbers from {-FARTHEST_FRAME} to {FARTHEST_FRAME}, "
                f"found {text.strip()}"
            )
        step = 1 if last >= first else -1
        if len(found) + abs(last - first) >= _MOST_FRAMES:
            raise FramesError(f"more than {_MOST_FRAMES} frames: shoot them in parts")
        found += range(first, last + step, step)
    return found


@dataclass(frozen=True)
class Shots:
    """How frames are shot: exposure in ms, degrees of the motion from half a frame before to half a
    frame after that are exposed, pauses in seconds. every_s: from one GO to the next, 0 for as soon
    as the pauses allow.

    move, motors: the upload, and its motors that move while the shutter is open. None: the motors
    that the device has set to blur.
    """

    exposure_ms: int
    shutter_angle: int
    move: Move | None = None
    motors: Sequence[int] = ()
    settle_s: float = 0.0
    pause_s: float = 0.0
    every_s: float = 0.0

    def request(self, frame: int) -> RtShootFrame2:
        """Return the request for a frame. The shutter is open in the middle of the motion."""
        opens = (_FULL_TURN - self.shutter_angle) // 2
        motors = []
        if self.move:
            index = frame - self.move.start_frame
            for motor in self.motors:
                motors.append(BlurMotor(motor, *ends(self.move.positions[motor], index)))
        return RtShootFrame2(frame, self.exposure_ms, opens, opens + self.shutter_angle, motors)


def shoot(
    client: Client,
    frames: Sequence[int],
    shots: Shots,
    display: ShotDisplay,
    done: Callable[[int], None],
) -> int:
    """Shoot frames of the upload, one after the other. `done` is called with each shot frame.
    Return how many came later than shots.every_s says, as the rig and the exposure take longer.

    Raises Stopped, with the reason, if something stops the motors, and RequestRefused (client.py).
    """
    client.events.clear()  # forget what has stopped motors before
    client.on_event = display.show
    late, due = 0, None
    try:
        for count, frame in enumerate(frames):
            display.shot(count, frame)
            # places motors that do not blur, and sets lights
            client.request(RtPositionFrame(frame))
            client.wait_idle(timeout_s=_ENDLESS)
            client.request(shots.request(frame))
            client.wait_idle(timeout_s=_ENDLESS)
            client.pump(shots.settle_s)
            now = client.clock()
            wanted = now if due is None else due + shots.every_s
            if shots.every_s and now > wanted + _LATE_S:
                late += 1
            due = max(wanted, now)
            client.pump(due - now)
            client.request(RtGo())
            client.wait_event(RtEnd, timeout_s=_ENDLESS)
            if is_stopped(client, shots.move.positions if shots.move else None):
                raise Stopped(f"frame {frame} was not shot: {why_stopped(client)}")
            client.wait_idle(timeout_s=_ENDLESS)
            done(frame)
            display.shot(count + 1, frame)
            if count + 1 < len(frames):
                client.pump(shots.pause_s)
    finally:
        client.on_event = None
    return late


def spans(frames: Sequence[int]) -> str:
    """Return frames as a user would type them: 1-12, 15."""
    found: list[list[int]] = []
    for frame in frames:
        if (
            found
            and abs(frame - found[-1][-1]) == 1
            and (len(found[-1]) == 1 or frame - found[-1][-1] == found[-1][-1] - found[-1][-2])
        ):
            found[-1].append(frame)
        else:
            found.append([frame])
    return ", ".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]) for run in found)
