"""Coupled motors: motor 2 moves as motor 1, or the opposite way.

The specification only has the capability's name; the flags come from Dragonframe's own header (note
3.1). So nothing here is a must.
"""

from collections.abc import Callable
from typing import Any

from .. import spec
from ..bench import FRAMES, Bench
from ..kit import Subject, once
from ..link import Failed
from ..sampling import Sample, motion, no_faster, ramps_down, ramps_up, watch
from ..spec import Request

_SAME, _REVERSED = 0x11, 0x31  # enabled and coupled
_SOURCE = "HI: Couple motors; note 3.1"
_STEPS = 300
_APART = 2  # allowed difference in steps in one sample
_PLAY = 30  # steps; more cannot be backlash


def _can(bench: Bench) -> bool:
    return bool(bench.hello.can & spec.CAN_COUPLE) and bench.hello.motors > 1


def _runs(bench: Bench) -> bool:
    return _can(bench) and bool(bench.hello.can & spec.CAN_RUN)


COUPLES = Subject("couples", _can)
_BOTH_WAYS = {"coupled": _SAME, "coupled in reverse": _REVERSED}


def _sense(flags: int) -> int:
    return 1 if flags == _SAME else -1


def _coupled(check):
    """Wrap a check: couple motors 1 and 2 before it, and uncouple them after it."""

    def run(bench: Bench, flags: int = _SAME, **values: Any):
        bench.expect(spec.configure(1, flags))
        _play(bench, flags)
        check(bench, flags, **values)
        bench.prepare()
        bench.return_home()

    return run


@once
def _play(bench: Bench, flags: int) -> int:
    """Return by how much motor 2 differs once both have turned.

    A device with backlash compensation reports positions of the load, and the two motors may have
    different backlash.
    """
    apart = [0]
    for steps in (60, 20, 0):
        bench.go(1, steps)
        now = bench.positions().steps
        lead, follow = now[0] - bench.home[0], now[1] - bench.home[1]
        apart.append(follow - _sense(flags) * lead)
    play = max(apart) - min(apart)
    return play if play <= _PLAY else 0


def _both_at(bench: Bench, steps: int, flags: int) -> None:
    bench.at(1, steps)
    bench.at(2, _sense(flags) * steps, _play(bench, flags))


def _together(bench: Bench, seen: list[Sample], flags: int) -> None:
    """Require that motor 2 has gone as far as motor 1 at each moment."""
    first, most = seen[0].steps, _APART + _play(bench, flags)
    for moment in seen:
        lead, follow = moment.steps[0] - first[0], moment.steps[1] - first[1]
        if abs(follow - _sense(flags) * lead) > most:
            raise Failed(f"motor 1 has gone {lead} steps, motor 2 {follow}")
    if abs(seen[-1].steps[0] - first[0]) < 10:
        raise Failed("the coupled motors did not move")


@COUPLES.should("MOVE of motor 1 takes motor 2 along, {flags}", _SOURCE, flags=_BOTH_WAYS)
@_coupled
def _moves(bench: Bench, flags: int):
    for steps in (_STEPS, -100):
        _together(bench, motion(bench, spec.move(1, bench.home[0] + steps)), flags)
        _both_at(bench, steps, flags)


@COUPLES.should("JOG of motor 1 takes motor 2 along, {flags}", _SOURCE, flags=_BOTH_WAYS)
@_coupled
def _jogs(bench: Bench, flags: int):
    _together(bench, motion(bench, spec.jog(1, 10000, bench.home[0] + 200)), flags)
    _both_at(bench, 200, flags)


@COUPLES.should(
    "{request} stops both by one ramp, {flags}",
    _SOURCE,
    flags=_BOTH_WAYS,
    request={
        "STOP of the leader": spec.stop(1),
        "STOP of the follower": spec.stop(2),
        "STOP_ALL": Request(spec.STOP_ALL),
    },
)
@_coupled
def _stops(bench: Bench, flags: int, request: Request):
    bench.expect(spec.move(1, bench.home[0] + 900))
    bench.link.pump(0.3)
    bench.expect(request)
    _together(bench, watch(bench, lambda: not bench.moving()), flags)
    found = bench.positions().steps[0] - bench.home[0]
    if found >= 800:
        raise Failed(f"after 0.3 s it was to stop; motor 1 came to rest at {found} of 900")
    _both_at(bench, found, flags)


@COUPLES.should("the slower motor's speed counts for both, {flags}", _SOURCE, flags=_BOTH_WAYS)
@_coupled
def _slower(bench: Bench, flags: int):
    """The follower has less velocity and acceleration than the leader."""
    bench.expect(spec.speed(2, 250, 500))
    seen = motion(bench, spec.move(1, bench.home[0] + _STEPS))
    for motor in (1, 2):
        no_faster(seen, motor, 250)
        ramps_up(seen, motor, 500)
        ramps_down(seen, motor, 500)
    _together(bench, seen, flags)


@COUPLES.should("a soft limit of motor 2 counts for both, {flags}", _SOURCE, flags=_BOTH_WAYS)
@_coupled
def _limited(bench: Bench, flags: int):
    """A soft limit of the follower also stops the leader."""
    home, up = bench.home[1], _sense(flags) > 0
    bench.expect(spec.limits(2, None, home + 80) if up else spec.limits(2, home - 80, None))
    bench.ask(spec.move(1, bench.home[0] + _STEPS))
    bench.idle()
    lead, follow = (p - h for p, h in zip(bench.positions().steps, bench.home[:2], strict=False))
    if abs(follow) > 80 or abs(lead - _sense(flags) * follow) > _play(bench, flags):
        raise Failed(f"motor 2 has its limit at 80; motor 1 went {lead} steps, motor 2 {follow}")


@COUPLES.should(
    "{request} of the follower is refused",
    _SOURCE,
    request={
        "MOVE": lambda b: spec.move(2, b.home[1] + 50),
        "JOG": lambda b: spec.jog(2, 10000, b.home[1] + 50),
    },
)
@_coupled
def _refused(bench: Bench, flags: int, request: Callable[[Bench], Request]):
    bench.refused(request(bench))
    bench.idle()
    _both_at(bench, 0, _SAME)


@COUPLES.should(
    "with the {motor} switched off MOVE is refused and neither motor moves",
    _SOURCE,
    motor={"leader": 1, "follower": 2},
)
@_coupled
def _disabled(bench: Bench, flags: int, motor: int):
    bench.expect(spec.configure(motor, _SAME & ~1 if motor == 1 else 0))
    bench.refused(spec.move(1, bench.home[0] + 50))
    bench.link.pump(0.3)
    _both_at(bench, 0, _SAME)


@COUPLES.should(
    "what is uploaded for motor 1 moves both, {flags}", _SOURCE, flags=_BOTH_WAYS, needs=_runs
)
@_coupled
def _plays(bench: Bench, flags: int):
    """An upload for the leader moves both, frame by frame."""
    path = [10 * i for i in range(FRAMES)]
    bench.expect(spec.begin(1, FRAMES))
    bench.expect(spec.axis(1, spec.LAST, [bench.home[0] + p for p in path]))
    bench.expect(Request(spec.UPLOAD_END))
    bench.expect(spec.run(12, 1, FRAMES))
    bench.idle()
    bench.link.reports.clear()
    bench.expect(Request(spec.GO))
    end = bench.link.clock() + 8
    while not bench.ends() and bench.link.clock() < end:
        bench.link.pump(0.1)
    bench.idle()
    play = _play(bench, flags)
    frames = [p for p in bench.reports() if p.move_time % 1000 == 0]
    if len(frames) < FRAMES - 1:
        raise Failed(f"a run of {FRAMES} frames reported {len(frames)}")
    for position in frames:
        lead, follow = (position.steps[i] - bench.home[i] for i in range(2))
        if abs(follow - _sense(flags) * lead) > _APART + play:
            frame = position.move_time // 1000
            raise Failed(f"at frame {frame} motor 1 has gone {lead} steps, motor 2 {follow}")


@COUPLES.should("coupled motors turn with the same backlash", _SOURCE)
def _reported_backlash(bench: Bench):
    bench.expect(spec.configure(1, _SAME))
    play = _play(bench, _SAME)
    bench.prepare()
    bench.return_home()
    return f"{play} steps between them once they have turned" if play else None


@COUPLES.should("motors that are apart keep their distance", _SOURCE)
def _apart(bench: Bench):
    """They keep the distance that they had when they were coupled."""
    bench.expect(spec.configure(1, _SAME))
    play = _play(bench, _SAME)
    bench.prepare()
    bench.go(2, 70)
    bench.expect(spec.configure(1, _SAME))
    bench.go(1, _STEPS)
    bench.at(1, _STEPS)
    bench.at(2, _STEPS + 70, 2 * play)
    bench.prepare()
    bench.return_home()


@COUPLES.should("motors that are no longer coupled move by themselves", _SOURCE)
def _released(bench: Bench):
    bench.expect(spec.configure(1, _SAME))
    bench.expect(spec.configure(1, 1))
    bench.go(1, 100)
    bench.at(2, 0)
    bench.go(2, -50)
    bench.at(1, 100)
    bench.return_home()


# One way after the other: what one leaves in the gears, the other would find as a difference.
COUPLES.checks.sort(key=lambda check: (", coupled" not in check.name, "in reverse" in check.name))
