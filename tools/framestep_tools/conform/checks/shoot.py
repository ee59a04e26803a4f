"""Go-motion: both kinds of SHOOT_FRAME, judged by positions requested during the exposure, and by
the camera's pins if a trace shows them."""

import struct
from typing import NamedTuple

from ...judge.trace import Edge
from .. import spec
from ..bench import FRAMES, Bench
from ..kit import MUST, SHOULD, Check
from ..link import Failed
from ..sampling import Sample, sample, took, watch
from ..spec import Request

CHECKS: list[Check] = []
_A, _B = 0, 160  # the blurred motor's positions at 0 and 360 degrees, from home
_FRAME = 4
_TOLERANCE = 0.1
_PINS_S = 0.004


def _can(bit: int, motors: int = 1, pins: bool = False):
    return lambda bench: (
        bool(bench.hello.can & bit)
        and bench.hello.motors >= motors
        and (bench.pins is not None or not pins)
    )


def _put(name, source, run, level=MUST, bit=spec.CAN_SHOOT, motors=1, pins=False):
    CHECKS.append(Check("shoot", name, source, run, level, _can(bit, motors, pins)))


def _shoot(frame: int, forward: bool, exposure_ms: int, blur: int, *pairs) -> Request:
    return Request(
        spec.SHOOT, struct.pack("<iBIH", frame, forward, exposure_ms, blur) + _pairs(pairs)
    )


def _shoot2(frame: int, exposure_ms: int, opens: int, closes: int, *pairs) -> Request:
    head = struct.pack("<iIhh", frame, exposure_ms, opens, closes)
    return Request(spec.SHOOT2, head + _pairs(pairs))


def _pairs(pairs) -> bytes:
    return b"".join(struct.pack("<Bii", *pair) for pair in pairs)


class Shot(NamedTuple):
    """Positions before GO, samples from GO to RT_END, the number of RT_ENDs, and the edges."""

    waits: tuple[int, ...]
    samples: list[Sample]
    ends: int
    edges: list[Edge]


def _shot(bench: Bench, request: Request) -> Shot:
    """Shoot with motor 1 in motion. Shot only once for all checks."""
    if request in bench.kept:
        return bench.kept[request]
    bench.upload()
    bench.expect(spec.configure(1, 3))
    bench.expect(request)
    bench.idle()
    waits = sample(bench).steps
    bench.link.pump(0.3)
    if bench.moving() or sample(bench).steps != waits:
        raise Failed("the motors did not wait for GO")
    bench.link.reports.clear()
    if bench.pins:
        bench.pins.take()
    bench.expect(Request(spec.GO))
    seen = watch(bench, lambda: bool(bench.ends()))
    bench.link.pump(0.3)
    shot = Shot(waits, seen, len(bench.ends()), bench.pins.take() if bench.pins else [])
    bench.idle()
    bench.prepare()
    bench.return_home()
    bench.kept[request] = shot
    return shot


def _span(shot: Shot, first: float, last: float, seconds: float, slack: float = _TOLERANCE) -> None:
    """Require the time that motor 1 takes from one position to another."""
    low, high = took(shot.samples, 1, first, last)
    if high < seconds * (1 - slack) or low > seconds * (1 + slack):
        raise Failed(
            f"motor 1 took {low:.3f} to {high:.3f} s from {first:.0f} to {last:.0f}, "
            f"expected {seconds:.3f} s"
        )


def _part(a: float, part: float, b: float) -> float:
    return a + (b - a) * part


# ---- SHOOT_FRAME

_KINDS = ((True, 400, 1000), (False, 400, 1000), (True, 800, 500), (False, 600, 500))


def _made(bench: Bench, kind) -> Shot:
    forward, exposure_ms, blur = kind
    home = bench.home[0]
    return _shot(bench, _shoot(_FRAME, forward, exposure_ms, blur, (1, home + _A, home + _B)))


def _window(kind):
    forward, exposure_ms, blur = kind

    def run(bench: Bench):
        a, b = (_A, _B) if forward else (_B, _A)
        half = blur / 2000
        first, last = _part(a, 0.5 - 0.8 * half, b), _part(a, 0.5 + 0.8 * half, b)
        _span(_made(bench, kind), first, last, 0.8 * exposure_ms / 1000)

    return run


def _once(make):
    def run(bench: Bench):
        if (ends := make(bench).ends) != 1:
            raise Failed(f"RT_END came {ends} times")

    return run


def _still(make):
    def run(bench: Bench):
        for seen in make(bench).samples:
            if seen.steps[1] != make(bench).waits[1]:
                raise Failed("motor 2 moved although it does not blur")

    return run


for _kind in _KINDS:
    _forward, _ms, _blur = _kind
    _text = f"{'forward' if _forward else 'backward'}, {_ms} ms, {_blur / 10:g} %"
    _make = lambda bench, kind=_kind: _made(bench, kind)  # noqa: E731 - one for each kind
    _put(
        f"SHOOT_FRAME {_text}: the blur takes the exposure",
        "MSG_RT_SHOOT_FRAME: EXPOSURE TIME, BLUR PERCENT; note 7.1",
        _window(_kind),
    )
    _put(f"SHOOT_FRAME {_text}: RT_END comes once", "MSG_RT_END", _once(_make))
    _put(
        f"SHOOT_FRAME {_text}: a motor without blur stays at rest",
        "MSG_MOTOR_CONFIGURE: 0x02 blur enabled; note 7.1",
        _still(_make),
        SHOULD,
        motors=2,
    )


def _listed(bench: Bench):
    home = bench.home
    request = _shoot(
        _FRAME, True, 300, 1000, (1, home[0] + _A, home[0] + _B), (2, home[1], home[1] + 90)
    )
    shot = _shot(bench, request)
    if any(seen.steps[1] != shot.waits[1] for seen in shot.samples):
        raise Failed("motor 2 moved, whose blur flag is not set")


_put(
    "SHOOT_FRAME: a motor in the list without its blur flag does not move",
    "MSG_MOTOR_CONFIGURE: 0x02 blur enabled; note 7.1",
    _listed,
    SHOULD,
    motors=2,
)

# ---- SHOOT_FRAME2

_KINDS2 = ((600, 0, 360), (400, 0, 180), (300, 90, 270), (500, 0, 180))


def _made2(bench: Bench, kind) -> Shot:
    home = bench.home[0]
    return _shot(bench, _shoot2(_FRAME, *kind, (1, home + _A, home + _B)))


def _turn(kind):
    """A turn lasts exposure x 360 / (CLOSE - OPEN). From a tenth to nine tenths of the distance a
    device takes 0.7 of it (with ramps inside the turn) to 0.8 (without)."""
    exposure_ms, opens, closes = kind

    def run(bench: Bench):
        turn = exposure_ms / 1000 * 360 / (closes - opens)
        shot = _made2(bench, kind)
        _span(shot, _part(_A, 0.1, _B), _part(_A, 0.9, _B), 0.75 * turn, 0.15)

    return run


def _waits(kind):
    def run(bench: Bench):
        if (found := _made2(bench, kind).waits[0]) != _A:
            raise Failed(f"motor 1 waits at {found}, POS A is {_A}")

    return run


def _rests(kind):
    def run(bench: Bench):
        if (found := _made2(bench, kind).samples[-1].steps[0]) != _B:
            raise Failed(f"motor 1 is at {found} when RT_END comes, POS B is {_B}")

    return run


for _kind2 in _KINDS2:
    _text = f"{_kind2[0]} ms, {_kind2[1]} to {_kind2[2]} degrees"
    _make = lambda bench, kind=_kind2: _made2(bench, kind)  # noqa: E731
    _two = spec.CAN_SHOOT2
    _put(
        f"SHOOT_FRAME2 {_text}: a turn lasts its time",
        "MSG_RT_SHOOT_FRAME2: Open, close shutter time, expressed as angle; note 7.2",
        _turn(_kind2),
        bit=_two,
    )
    _put(f"SHOOT_FRAME2 {_text}: waits on POS A", "note 7.3", _waits(_kind2), SHOULD, _two)
    _put(f"SHOOT_FRAME2 {_text}: ends on POS B", "note 7.3", _rests(_kind2), SHOULD, _two)
    _put(f"SHOOT_FRAME2 {_text}: RT_END comes once", "MSG_RT_END", _once(_make), bit=_two)
    _put(
        f"SHOOT_FRAME2 {_text}: a motor without blur stays at rest",
        "MSG_MOTOR_CONFIGURE: 0x02 blur enabled",
        _still(_make),
        SHOULD,
        _two,
        2,
    )


def _from_path(bench: Bench):
    path = bench.path(1)
    a = (path[_FRAME - 2] + path[_FRAME - 1]) / 2 - bench.home[0]
    b = (path[_FRAME - 1] + path[_FRAME]) / 2 - bench.home[0]
    shot = _shot(bench, _shoot2(_FRAME, 600, 0, 360))
    for found, wanted, where in ((shot.waits[0], a, "A"), (shot.samples[-1].steps[0], b, "B")):
        if abs(found - wanted) > 3:
            raise Failed(f"POS {where} by the path is about {wanted:.0f}, motor 1 was at {found}")


_put(
    "SHOOT_FRAME2 without pairs: A and B are half a frame before and after",
    "The sets of motor numbers and positions are optional; note 7.2",
    _from_path,
    SHOULD,
    spec.CAN_SHOOT2,
)

# ---- the camera's pins


def _levels(shot: Shot, signal: str) -> list[tuple[float, int]]:
    return [(time * 1e-9, value) for time, name, value in shot.edges if name == signal]


def _step_at(shot: Shot, time_s: float) -> int:
    made = [value for time, name, value in shot.edges if name == "m1" and time * 1e-9 <= time_s]
    return shot.waits[0] + sum(made)


def _opened(shot: Shot, signal: str) -> tuple[float, float]:
    levels = _levels(shot, signal)
    if [value for _, value in levels][-2:] != [1, 0]:
        raise Failed(f"the {signal} was not switched on and off again")
    return levels[-2][0], levels[-1][0]


def _shutter(make, exposure_ms: int, a: int | None, b: int | None):
    def run(bench: Bench):
        shot = make(bench)
        begin, end = _opened(shot, "shutter")
        if abs(end - begin - exposure_ms / 1000) > _PINS_S:
            raise Failed(
                f"the shutter was open for {(end - begin) * 1000:.1f} ms, the exposure is "
                f"{exposure_ms} ms"
            )
        for time, wanted in ((begin, a), (end, b)):
            if wanted is not None and abs(_step_at(shot, time) - wanted) > 2:
                raise Failed(
                    f"at an edge of the shutter motor 1 was at {_step_at(shot, time)}, "
                    f"expected {wanted}"
                )

    return run


for _kind in _KINDS:
    _forward, _ms, _blur = _kind
    _way = (_A, _B) if _forward else (_B, _A)
    _half = _blur / 2000
    _put(
        f"SHOOT_FRAME {'forward' if _forward else 'backward'}, {_ms} ms, {_blur / 10:g} %: "
        "the shutter is open for the blur",
        "MSG_RT_SHOOT_FRAME: EXPOSURE TIME; note 7.1",
        _shutter(
            lambda bench, kind=_kind: _made(bench, kind),
            _ms,
            round(_part(_way[0], 0.5 - _half, _way[1])),
            round(_part(_way[0], 0.5 + _half, _way[1])),
        ),
        SHOULD,
        pins=True,
    )
for _kind2 in _KINDS2:
    _put(
        f"SHOOT_FRAME2 {_kind2[0]} ms, {_kind2[1]} to {_kind2[2]} degrees: the shutter is open for "
        "the exposure",
        "MSG_RT_SHOOT_FRAME2: EXPOSURE TIME",
        _shutter(lambda bench, kind=_kind2: _made2(bench, kind), _kind2[0], None, None),
        SHOULD,
        spec.CAN_SHOOT2,
        pins=True,
    )

# ---- refusals


def _refused(make, *codes: int):
    def run(bench: Bench):
        bench.upload()
        bench.expect(make(bench), *codes)

    return run


for _number in (0, FRAMES + 1):
    _put(
        f"SHOOT_FRAME of frame {_number}, outside the upload, is refused",
        "MSG_RT_SHOOT_FRAME: A frame in the uploaded move; ERR_RANGE",
        _refused(lambda b, n=_number: _shoot(n, True, 500, 1000), spec.ERR_RANGE),
    )
    _put(
        f"SHOOT_FRAME2 of frame {_number}, outside the upload, is refused",
        "MSG_RT_SHOOT_FRAME2: A frame in the uploaded move; ERR_RANGE",
        _refused(lambda b, n=_number: _shoot2(n, 500, 0, 360), spec.ERR_RANGE),
        bit=spec.CAN_SHOOT2,
    )
for _motor in (0, 33, 255):
    _put(
        f"SHOOT_FRAME with motor {_motor} in its list is refused",
        "MSG_RT_SHOOT_FRAME: Motor number; ERR_RANGE",
        _refused(lambda b, m=_motor: _shoot(_FRAME, True, 500, 1000, (m, 0, 0)), spec.ERR_RANGE),
    )
    _put(
        f"SHOOT_FRAME2 with motor {_motor} in its list is refused",
        "MSG_RT_SHOOT_FRAME2: Motor number; ERR_RANGE",
        _refused(lambda b, m=_motor: _shoot2(_FRAME, 500, 0, 360, (m, 0, 0)), spec.ERR_RANGE),
        bit=spec.CAN_SHOOT2,
    )


def _moving(bench: Bench):
    bench.upload()
    bench.expect(spec.move(1, bench.home[0] + 200))
    bench.expect(_shoot(_FRAME, True, 500, 1000), spec.ERR_MOVING)
    bench.idle()
    bench.return_home()


_put("SHOOT_FRAME while a motor moves is refused", "ERR_MOVING; note 6.1", _moving, SHOULD)


def _nothing(bench: Bench):
    bench.expect(spec.begin(1, FRAMES))
    bench.refused(_shoot(_FRAME, True, 500, 1000))


_put("SHOOT_FRAME before UPLOAD_MOVE_END is refused", "note 5.4", _nothing, SHOULD)


def _stopped(bench: Bench):
    home = bench.home[0]
    bench.upload()
    bench.expect(spec.configure(1, 3))
    bench.expect(_shoot(_FRAME, True, 2000, 1000, (1, home + _A, home + _B)))
    bench.idle()
    bench.link.reports.clear()
    bench.expect(Request(spec.GO))
    bench.link.pump(1.2)
    bench.expect(Request(spec.STOP_ALL))
    bench.idle(2)
    bench.link.pump(0.3)
    ends = len(bench.ends())
    bench.prepare()
    bench.return_home()
    if ends != 1:
        raise Failed(f"RT_END came {ends} times after STOP_ALL ended an exposure")


_put("STOP_ALL ends an exposure, with RT_END", "MSG_MOTOR_STOP_ALL; note 6.6", _stopped, SHOULD)
