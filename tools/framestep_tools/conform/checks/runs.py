"""Runs of an uploaded move at several rates, forward and backward, and their answers."""

from collections.abc import Callable
from typing import Any

from .. import spec
from ..bench import FRAMES, Bench, Played
from ..kit import Subject
from ..link import Failed
from ..spec import Request

_LATE_S = 0.06  # lateness of one frame's report against the others'


def _can(bench: Bench) -> bool:
    return bool(bench.hello.can & spec.CAN_RUN) and bench.hello.motors > 0


RUNS = Subject("runs", _can)
_WAYS: dict[str, Any] = {
    "fps": (6, 12, 23.976, 24, 25, 29.97, 30, 48),
    "back": {"forward": False, "backward": True},
}


def _played(bench: Bench, fps: float, back: bool) -> Played:
    first, last = (FRAMES, 1) if back else (1, FRAMES)
    return bench.play(spec.run(fps, first, last), FRAMES / fps + 6)


def _frames(played: Played):
    """Return {frame: Position}, the report of each reached frame. In the pre-roll MOVE TIME may
    already be the start frame, so for that one the last report counts."""
    found = {}
    start = next((p.move_time for p in played.positions), None)
    for position in played.positions:
        if position.move_time % 1000 == 0 and position.time_s <= played.ends[0]:
            number = position.move_time // 1000
            if number not in found or position.move_time == start:
                found[number] = position
    return found


@RUNS.must(
    "{fps} frames/s {back}: each frame is reported",
    "MSG_RT_GO: GET_POSITION each time it reaches a new frame",
    **_WAYS,
)
def _each(bench: Bench, fps, back):
    seen = {p.move_time // 1000 for p in _played(bench, fps, back).positions}
    if missing := set(range(1, FRAMES + 1)) - seen:
        raise Failed(f"no GET_POSITION for the frames {sorted(missing)}")
    if extra := seen - set(range(1, FRAMES + 1)):
        raise Failed(f"MOVE TIME names the frames {sorted(extra)}, outside the run")


@RUNS.must(
    "{fps} frames/s {back}: positions of whole frames are the uploaded ones",
    "MSG_RT_GO; note 4.6",
    **_WAYS,
)
def _right(bench: Bench, fps, back):
    for number, position in _frames(_played(bench, fps, back)).items():
        if not 1 <= number <= FRAMES:
            raise Failed(f"MOVE TIME names frame {number}, outside the run")
        if off := bench.off_path(number, position):
            raise Failed(off)


@RUNS.must("{fps} frames/s {back}: frames come at their times", "MSG_RT_RUN_MOVE: FPS", **_WAYS)
def _timed(bench: Bench, fps, back):
    frames = _frames(_played(bench, fps, back))
    numbers = sorted(frames, reverse=back)
    if len(numbers) < 2:
        raise Failed("fewer than two whole frames were reported")
    start = frames[numbers[0]].time_s
    for number in numbers:
        late = frames[number].time_s - start - abs(number - numbers[0]) / fps
        if abs(late) > _LATE_S:
            raise Failed(f"frame {number} is {late * 1000:+.0f} ms from its time")


@RUNS.must(
    "{fps} frames/s {back}: RT_END comes once, after the end", "MSG_RT_END; note 6.4", **_WAYS
)
def _ended(bench: Bench, fps, back):
    played = _played(bench, fps, back)
    if len(played.ends) != 1:
        raise Failed(f"RT_END came {len(played.ends)} times")
    frames = _frames(played)
    last = frames.get(1 if back else FRAMES)
    if last is None:
        raise Failed("the last frame was not reported before RT_END")
    after = played.ends[0] - last.time_s
    if not -0.01 < after < 0.2 + 1 / fps + 0.6:
        raise Failed(f"RT_END came {after:.2f} s after the last frame, with a post-roll of 0.2 s")


@RUNS.should(
    "{request} during a run is refused",
    "ERR_MOVING; note 5.2",
    request={
        "RUN_MOVE": lambda b: spec.run(12, 1, FRAMES),
        "POSITION_FRAME": lambda b: spec.frame(2),
        "JOG_ALL": lambda b: spec.jog_all(12, 2),
        "UPLOAD_MOVE_BEGIN": lambda b: spec.begin(1, 5),
        "RESET_POSITION": lambda b: spec.reset(1, b.home[0]),
    },
)
def _during(bench: Bench, request: Callable[[Bench], Request]):
    bench.upload()
    bench.expect(spec.run(12, 1, FRAMES))
    bench.idle()
    bench.expect(Request(spec.GO))
    bench.link.pump(0.4)
    bench.expect(request(bench), spec.ERR_MOVING)
    bench.expect(Request(spec.STOP_ALL))
    bench.idle()
    bench.return_home()


@RUNS.should("GO without a run is refused", "MSG_RT_GO: after a RUN_MOVE or SHOOT_FRAME")
def _go_alone(bench: Bench):
    bench.upload()
    bench.expect(Request(spec.GO), *(code for code in spec.CODES if code != spec.OK))


@RUNS.must("GO before the motors are in position is refused", "ERR_NOT_IN_POSITION; note 6.1")
def _go_early(bench: Bench):
    bench.upload()
    bench.go(1, 500)
    bench.expect(spec.run(12, 1, FRAMES))
    bench.expect(Request(spec.GO), spec.ERR_NOT_IN_POSITION)
    bench.idle()
    bench.expect(Request(spec.STOP_ALL))
    bench.idle()
    bench.return_home()


@RUNS.must("a run waits for GO", "MSG_RT_RUN_MOVE: it must wait for a MSG_RT_GO")
def _waits(bench: Bench):
    bench.upload()
    bench.expect(spec.run(12, 1, FRAMES))
    bench.idle()
    bench.link.pump(0.5)
    if bench.moving():
        raise Failed("the run began without GO")
    bench.expect(Request(spec.STOP_ALL))


@RUNS.should(
    "the pre-roll begins where constant acceleration reaches the path's velocity",
    "MSG_RT_RUN_MOVE: pre-roll; note 6.2",
)
def _preroll(bench: Bench):
    home = bench.home[0]
    bench.expect(spec.begin(1, FRAMES))
    bench.expect(spec.axis(1, spec.LAST, [home + 10 * i for i in range(FRAMES)]))
    bench.expect(Request(spec.UPLOAD_END))
    bench.expect(spec.run(24, 1, FRAMES, pre_ms=500))
    bench.idle()
    bench.at(1, -60, within=2)
    bench.expect(Request(spec.STOP_ALL))
    bench.return_home()


@RUNS.must("a pre-roll past a limit is refused", "ERR_PREROLL")
def _preroll_limit(bench: Bench):
    home = bench.home[0]
    bench.expect(spec.begin(1, FRAMES))
    bench.expect(spec.axis(1, spec.LAST, [home + 10 * i for i in range(FRAMES)]))
    bench.expect(Request(spec.UPLOAD_END))
    bench.expect(spec.limits(1, home - 20, None))
    bench.expect(spec.run(24, 1, FRAMES, pre_ms=500), spec.ERR_PREROLL)
    bench.expect(spec.limits(1))


@RUNS.should("STOP_ALL ends a run with RT_END", "MSG_MOTOR_STOP_ALL; note 6.6")
def _stopped(bench: Bench):
    bench.upload()
    bench.expect(spec.run(6, 1, FRAMES))
    bench.idle()
    bench.link.reports.clear()
    bench.expect(Request(spec.GO))
    bench.link.pump(0.8)
    bench.expect(Request(spec.STOP_ALL))
    bench.idle()
    bench.link.pump(0.3)
    if (ends := bench.ends()) and len(ends) == 1:
        bench.return_home()
        return
    raise Failed(f"RT_END came {len(ends)} times after STOP_ALL ended a run")
