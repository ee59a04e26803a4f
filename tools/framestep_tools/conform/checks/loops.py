"""Loops and ping-pong, and their end by STOP_LOOP, judged by the reported play head and
positions."""

from typing import NamedTuple

from .. import spec
from ..bench import FRAMES, Bench, Position
from ..kit import Subject, once
from ..link import Failed
from ..spec import Request

_FLAGS = "MSG_RT_RUN_MOVE: FLAGS 0x01 is ping-pong, 0x02 is loop"
_STOP = "MSG_RT_STOP_LOOP: must stop after it reaches the next end point"
_LATE_S = 0.06
_PASS_S = 8.0


def _can(bench: Bench) -> bool:
    return (
        bool(bench.hello.can & spec.CAN_RUN)
        and bool(bench.hello.can & spec.CAN_LOOP)
        and bench.hello.motors > 0
    )


LOOPS = Subject("loops", _can)


class Way(NamedTuple):
    """What is played: rate, direction, kind, and the lap in which STOP_LOOP comes."""

    fps: float
    back: bool
    flag: int
    stop_in: int

    def __str__(self) -> str:
        kind = "loop" if self.flag == spec.LOOP else "ping-pong"
        way = "backward" if self.back else "forward"
        return f"{kind} {way} at {self.fps} frames/s, STOP_LOOP in lap {self.stop_in}"

    @property
    def ends(self) -> tuple[int, int]:
        """Return the first and the last frame of the request."""
        return (FRAMES, 1) if self.back else (1, FRAMES)

    def frames(self, number: int) -> list[int]:
        """Return the frames of a lap; laps count from 1."""
        first, last = self.ends
        step = 1 if last > first else -1
        frames = list(range(first, last + step, step))
        return frames[::-1] if self.flag == spec.PING_PONG and number % 2 == 0 else frames


_WAYS = (
    Way(24, False, spec.LOOP, 2),
    Way(12, False, spec.LOOP, 1),
    Way(12, True, spec.LOOP, 2),
    Way(25, False, spec.LOOP, 3),
    Way(24, False, spec.PING_PONG, 2),
    Way(12, False, spec.PING_PONG, 3),
    Way(12, False, spec.PING_PONG, 1),
    Way(30, True, spec.PING_PONG, 2),
)


class Looped(NamedTuple):
    """Reports of each lap (its whole frames in order), whole frames between laps, the numbers of
    RT_ENDs before STOP_LOOP and in all, the time of STOP_LOOP, the final positions."""

    laps: list[dict[int, Position]]
    between: list[int]
    early: int
    ends: list[float]
    stopped_s: float
    positions: tuple[int, ...]


def _laps(way: Way, reports: list[Position]) -> tuple[list[dict[int, Position]], list[int]]:
    """Return whole frames in the order that a lap should have, and frames between laps."""
    between: list[int] = []
    laps: list[dict[int, Position]] = [{}]
    wanted = way.frames(1)
    for report in reports:
        number, part = divmod(report.move_time, 1000)
        if part:
            continue
        if len(laps[-1]) == len(wanted):
            follows = way.frames(len(laps) + 1)
            if number == follows[0] and report.time_s - laps[-1][wanted[-1]].time_s > 0.5 / way.fps:
                wanted = follows
                laps.append({number: report})
            elif number not in way.ends:
                between.append(number)
            continue
        expected = wanted[len(laps[-1])]
        if number == expected:
            laps[-1][number] = report
        elif laps[-1] and number == wanted[len(laps[-1]) - 1] and len(laps[-1]) == 1:
            laps[-1][number] = report  # in the pre-roll MOVE TIME is the start frame as well
    return laps, between


@once
def _played(bench: Bench, way: Way) -> Looped:
    bench.upload()
    bench.expect(spec.run(way.fps, *way.ends, flags=way.flag))
    bench.idle()
    bench.link.reports.clear()
    bench.expect(Request(spec.GO))
    limit = bench.link.clock() + _PASS_S * way.stop_in + 2
    while True:
        laps, _ = _laps(way, bench.reports())
        if len(laps) > way.stop_in or (len(laps) == way.stop_in and len(laps[-1]) >= 4):
            break
        if bench.ends():
            break
        if bench.link.clock() > limit:
            raise Failed(f"lap {way.stop_in} was not seen: it got to {_seen(laps)}")
        bench.link.pump(0.02)
    early = len(bench.ends())
    bench.expect(Request(spec.STOP_LOOP))
    stopped = bench.link.clock()
    while not bench.ends() and bench.link.clock() < stopped + _PASS_S:
        bench.link.pump(0.05)
    bench.link.pump(0.2)
    ends = bench.ends()
    laps, between = _laps(way, [r for r in bench.reports() if not ends or r.time_s <= ends[0]])
    if len(laps) > 1 and len(laps[-1]) == 1:
        laps.pop()  # in the post-roll MOVE TIME stays at the end frame
    if not ends:
        bench.expect(Request(spec.STOP_ALL))
    bench.idle()
    looped = Looped(laps, between, early, ends, stopped, bench.positions().steps)
    bench.return_home()
    return looped


def _seen(laps: list[dict[int, Position]]) -> str:
    return "; ".join(" ".join(str(number) for number in one) or "none" for one in laps)


@LOOPS.must("{way}: it runs until then", _FLAGS, way=_WAYS)
def _goes_on(bench: Bench, way: Way):
    if _played(bench, way).early:
        raise Failed("RT_END came before STOP_LOOP")


@LOOPS.must("{way}: that lap is the last, and complete", _STOP, way=_WAYS)
def _counted(bench: Bench, way: Way):
    laps = _played(bench, way).laps
    if len(laps) != way.stop_in or len(laps[-1]) != FRAMES:
        raise Failed(
            f"STOP_LOOP came in lap {way.stop_in}, which has to be the last one and be played "
            f"to its end; whole frames reported: {_seen(laps)}"
        )


@LOOPS.should("{way}: no frames are played between laps", _FLAGS, way=_WAYS)
def _one_way(bench: Bench, way: Way):
    if between := _played(bench, way).between:
        raise Failed(f"frames {between} were reached between two laps")


@LOOPS.must("{way}: whole frames are where they were uploaded", _FLAGS, way=_WAYS)
def _placed(bench: Bench, way: Way):
    for number, frames in enumerate(_played(bench, way).laps, 1):
        for frame, position in frames.items():
            if off := bench.off_path(frame, position):
                raise Failed(f"in lap {number} {off}")


@LOOPS.must("{way}: frames come at their times", "MSG_RT_RUN_MOVE: FPS", way=_WAYS)
def _timed(bench: Bench, way: Way):
    for number, frames in enumerate(_played(bench, way).laps, 1):
        first = next(iter(frames.values())).time_s
        for i, (frame, position) in enumerate(frames.items()):
            late = position.time_s - first - i / way.fps
            if abs(late) > _LATE_S:
                raise Failed(
                    f"in lap {number} frame {frame} is {late * 1000:+.0f} ms from its time"
                )


@LOOPS.must("{way}: RT_END comes once, after the last lap", "MSG_RT_END; note 6.6", way=_WAYS)
def _ended(bench: Bench, way: Way):
    played = _played(bench, way)
    if len(played.ends) != 1:
        raise Failed(f"RT_END came {len(played.ends)} times after STOP_LOOP")
    last = list(played.laps[-1].values())[-1].time_s
    after = played.ends[0] - last
    if not -0.01 < after < 0.2 + 1 / way.fps + 0.6:
        raise Failed(f"RT_END came {after:.2f} s after the last frame")


@LOOPS.should("{way}: the motors rest on its last frame", "note 6.11", way=_WAYS)
def _rests(bench: Bench, way: Way):
    played = _played(bench, way)
    frame = way.frames(way.stop_in)[-1]
    for motor in range(1, min(2, bench.hello.motors) + 1):
        wanted = bench.path(motor)[frame - 1]
        if played.positions[motor - 1] != wanted:
            raise Failed(
                f"afterwards motor {motor} is at {played.positions[motor - 1]}, "
                f"frame {frame} is at {wanted}"
            )


@LOOPS.should("STOP_LOOP before GO cancels the loop", "note 6.12")
def _cancelled(bench: Bench):
    bench.upload()
    bench.expect(spec.run(24, 1, FRAMES, flags=spec.LOOP))
    bench.idle()
    bench.expect(Request(spec.STOP_LOOP))
    bench.link.reports.clear()
    bench.expect(Request(spec.GO))
    bench.link.pump(FRAMES / 24 + 1.5)
    ends = len(bench.ends())
    bench.expect(Request(spec.STOP_ALL))
    bench.idle()
    bench.return_home()
    if ends != 1:
        raise Failed("the loop ran although STOP_LOOP came before GO")


@LOOPS.should("STOP_LOOP without a loop is accepted", "MSG_RT_STOP_LOOP; note 6.12")
def _nothing_to_stop(bench: Bench):
    bench.expect(Request(spec.STOP_LOOP))


@LOOPS.should(
    "STOP_ALL ends a {flag} for good, with RT_END",
    "MSG_MOTOR_STOP_ALL; note 6.6",
    flag={"loop": spec.LOOP, "ping-pong": spec.PING_PONG},
)
def _stopped(bench: Bench, flag: int):
    bench.upload()
    bench.expect(spec.run(12, 1, FRAMES, flags=flag))
    bench.idle()
    bench.link.reports.clear()
    bench.expect(Request(spec.GO))
    bench.link.pump(0.8)
    bench.expect(Request(spec.STOP_ALL))
    bench.idle(3)
    bench.link.pump(1.5)
    ends = len(bench.ends())
    bench.idle(0.1)
    bench.return_home()
    if ends != 1:
        raise Failed(f"RT_END came {ends} times after STOP_ALL")
