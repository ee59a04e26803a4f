"""Coupled motors: motor 2 moves as motor 1, or the opposite way.

The specification only has the capability's name; the flags come from Dragonframe's own header (note
3.1). So nothing here is a must.
"""

from collections.abc import Callable

from .. import spec
from ..bench import FRAMES, Bench
from ..kit import SHOULD, Check
from ..link import Failed
from ..sampling import Sample, motion, no_faster, ramps_down, ramps_up, watch
from ..spec import Request

CHECKS: list[Check] = []
_SAME, _REVERSED = 0x11, 0x31  # enabled and coupled
_SOURCE = "HI: Couple motors; note 3.1"
_STEPS = 300
_APART = 2  # allowed difference in steps in one sample
_PLAY = 30  # steps; more cannot be backlash


def _can(bench: Bench) -> bool:
    return bool(bench.hello.can & spec.CAN_COUPLE) and bench.hello.motors > 1


def _runs(bench: Bench) -> bool:
    return _can(bench) and bool(bench.hello.can & spec.CAN_RUN)


def _put(name, run, needs=_can):
    CHECKS.append(Check("couples", name, _SOURCE, run, SHOULD, needs))


def _sense(flags: int) -> int:
    return 1 if flags == _SAME else -1


def _coupled(flags: int, check: Callable[[Bench], None]):
    """Run a check with motors 1 and 2 coupled, and uncouple them afterwards."""

    def run(bench: Bench):
        bench.expect(spec.configure(1, flags))
        _play(bench, flags)
        check(bench)
        bench.prepare()
        bench.return_home()

    return run


def _play(bench: Bench, flags: int) -> int:
    """Return by how much motor 2 differs once both have turned.

    A device with backlash compensation reports positions of the load, and the two motors may have
    different backlash.
    """
    key = "play of a couple", flags
    if key not in bench.kept:
        apart = [0]
        for steps in (60, 20, 0):
            bench.go(1, steps)
            now = bench.positions().steps
            lead, follow = now[0] - bench.home[0], now[1] - bench.home[1]
            apart.append(follow - _sense(flags) * lead)
        play = max(apart) - min(apart)
        bench.kept[key] = play if play <= _PLAY else 0
    return bench.kept[key]


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


def _moves(flags: int):
    def check(bench: Bench):
        for steps in (_STEPS, -100):
            _together(bench, motion(bench, spec.move(1, bench.home[0] + steps)), flags)
            _both_at(bench, steps, flags)

    return check


def _jogs(flags: int):
    def check(bench: Bench):
        _together(bench, motion(bench, spec.jog(1, 10000, bench.home[0] + 200)), flags)
        _both_at(bench, 200, flags)

    return check


def _stops(request: Request, flags: int):
    def check(bench: Bench):
        bench.expect(spec.move(1, bench.home[0] + 900))
        bench.link.pump(0.3)
        bench.expect(request)
        _together(bench, watch(bench, lambda: not bench.moving()), flags)
        found = bench.positions().steps[0] - bench.home[0]
        if found >= 800:
            raise Failed(f"after 0.3 s it was to stop; motor 1 came to rest at {found} of 900")
        _both_at(bench, found, flags)

    return check


def _slower(flags: int):
    """The follower has less velocity and acceleration than the leader."""

    def check(bench: Bench):
        bench.expect(spec.speed(2, 250, 500))
        seen = motion(bench, spec.move(1, bench.home[0] + _STEPS))
        for motor in (1, 2):
            no_faster(seen, motor, 250)
            ramps_up(seen, motor, 500)
            ramps_down(seen, motor, 500)
        _together(bench, seen, flags)

    return check


def _limited(flags: int):
    """A soft limit of the follower also stops the leader."""

    def check(bench: Bench):
        home, up = bench.home[1], _sense(flags) > 0
        bench.expect(spec.limits(2, None, home + 80) if up else spec.limits(2, home - 80, None))
        bench.ask(spec.move(1, bench.home[0] + _STEPS))
        bench.idle()
        lead, follow = (
            p - h for p, h in zip(bench.positions().steps, bench.home[:2], strict=False)
        )
        if abs(follow) > 80 or abs(lead - _sense(flags) * follow) > _play(bench, flags):
            raise Failed(
                f"motor 2 has its limit at 80; motor 1 went {lead} steps, motor 2 {follow}"
            )

    return check


def _refused(request: Callable[[Bench], Request]):
    def check(bench: Bench):
        bench.refused(request(bench))
        bench.idle()
        _both_at(bench, 0, _SAME)

    return check


def _disabled(motor: int):
    def check(bench: Bench):
        bench.expect(spec.configure(motor, _SAME & ~1 if motor == 1 else 0))
        bench.refused(spec.move(1, bench.home[0] + 50))
        bench.link.pump(0.3)
        _both_at(bench, 0, _SAME)

    return check


def _plays(flags: int):
    """An upload for the leader moves both, frame by frame."""

    def check(bench: Bench):
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

    return check


def _reported_backlash(bench: Bench):
    bench.expect(spec.configure(1, _SAME))
    play = _play(bench, _SAME)
    bench.prepare()
    bench.return_home()
    return f"{play} steps between them once they have turned" if play else None


def _apart(bench: Bench):
    """They keep the distance that they had when they were coupled."""
    bench.go(2, 70)
    bench.expect(spec.configure(1, _SAME))
    bench.go(1, _STEPS)
    bench.at(1, _STEPS)
    bench.at(2, _STEPS + 70, 2 * bench.kept.get(("play of a couple", _SAME), 0))
    bench.prepare()
    bench.return_home()


def _released(bench: Bench):
    bench.expect(spec.configure(1, _SAME))
    bench.expect(spec.configure(1, 1))
    bench.go(1, 100)
    bench.at(2, 0)
    bench.go(2, -50)
    bench.at(1, 100)
    bench.return_home()


for _flags, _how in ((_SAME, "coupled"), (_REVERSED, "coupled in reverse")):
    _put(f"MOVE of motor 1 takes motor 2 along, {_how}", _coupled(_flags, _moves(_flags)))
    _put(f"JOG of motor 1 takes motor 2 along, {_how}", _coupled(_flags, _jogs(_flags)))
    for _name, _request in (
        ("STOP of the leader", spec.stop(1)),
        ("STOP of the follower", spec.stop(2)),
        ("STOP_ALL", Request(spec.STOP_ALL)),
    ):
        _put(f"{_name} stops both by one ramp, {_how}", _coupled(_flags, _stops(_request, _flags)))
    _put(f"the slower motor's speed counts for both, {_how}", _coupled(_flags, _slower(_flags)))
    _put(f"a soft limit of motor 2 counts for both, {_how}", _coupled(_flags, _limited(_flags)))
    _put(
        f"what is uploaded for motor 1 moves both, {_how}", _coupled(_flags, _plays(_flags)), _runs
    )
for _name, _make in (
    ("MOVE", lambda b: spec.move(2, b.home[1] + 50)),
    ("JOG", lambda b: spec.jog(2, 10000, b.home[1] + 50)),
):
    _put(f"{_name} of the follower is refused", _coupled(_SAME, _refused(_make)))
for _motor, _who in ((1, "leader"), (2, "follower")):
    _put(
        f"with the {_who} switched off MOVE is refused and neither motor moves",
        _coupled(_SAME, _disabled(_motor)),
    )
_put("coupled motors turn with the same backlash", _reported_backlash)
_put("motors that are apart keep their distance", _apart)
_put("motors that are no longer coupled move by themselves", _released)
