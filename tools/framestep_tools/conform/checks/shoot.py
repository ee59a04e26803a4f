"""Go-motion: both kinds of SHOOT_FRAME, judged by positions requested during the exposure, and by
the camera's pins if a trace shows them."""

import struct
from typing import NamedTuple

from ...judge.trace import Edge
from .. import spec
from ..bench import FRAMES, Bench
from ..kit import Subject, once
from ..link import Failed
from ..sampling import Sample, sample, took, watch
from ..spec import Request

_A, _B = 0, 160  # the blurred motor's positions at 0 and 360 degrees, from home
_FRAME = 4
_TOLERANCE = 0.1
_PINS_S = 0.004


def _two(bench: Bench) -> bool:
    return bench.hello.motors > 1


def _pins(bench: Bench) -> bool:
    return bench.pins is not None


_BOTH = Subject("shoot", lambda bench: bench.hello.motors > 0)
SHOOT = _BOTH.where(lambda bench: bench.hello.can & spec.CAN_SHOOT)
SHOOT2 = _BOTH.where(lambda bench: bench.hello.can & spec.CAN_SHOOT2)


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


@once
def _shot(bench: Bench, request: Request) -> Shot:
    """Shoot with motor 1 in motion. Shot only once for all checks."""
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


class Exposure(NamedTuple):
    """SHOOT_FRAME: direction, time, and the part of it that is blurred, in 1/1000."""

    forward: bool
    ms: int
    blur: int

    def __str__(self) -> str:
        way = "forward" if self.forward else "backward"
        return f"{way}, {self.ms} ms, {self.blur / 10:g} %"

    def shoot(self, bench: Bench) -> Shot:
        pair = (1, bench.home[0] + _A, bench.home[0] + _B)
        return _shot(bench, _shoot(_FRAME, self.forward, self.ms, self.blur, pair))

    def place(self, part: float) -> float:
        """Return the position after a part of the distance."""
        a, b = (_A, _B) if self.forward else (_B, _A)
        return _part(a, part, b)


_EXPOSURES = (
    Exposure(True, 400, 1000),
    Exposure(False, 400, 1000),
    Exposure(True, 800, 500),
    Exposure(False, 600, 500),
)


class Turn(NamedTuple):
    """SHOOT_FRAME2: time, and the angles at which the shutter opens and closes."""

    ms: int
    opens: int
    closes: int

    def __str__(self) -> str:
        return f"{self.ms} ms, {self.opens} to {self.closes} degrees"

    def shoot(self, bench: Bench) -> Shot:
        pair = (1, bench.home[0] + _A, bench.home[0] + _B)
        return _shot(bench, _shoot2(_FRAME, *self, pair))


_TURNS = (Turn(600, 0, 360), Turn(400, 0, 180), Turn(300, 90, 270), Turn(500, 0, 180))
_BLUR = "MSG_MOTOR_CONFIGURE: 0x02 blur enabled"


# ---- both


@SHOOT.must("SHOOT_FRAME {exposure}: RT_END comes once", "MSG_RT_END", exposure=_EXPOSURES)
@SHOOT2.must("SHOOT_FRAME2 {exposure}: RT_END comes once", "MSG_RT_END", exposure=_TURNS)
def _ends_once(bench: Bench, exposure: Exposure | Turn):
    if (ends := exposure.shoot(bench).ends) != 1:
        raise Failed(f"RT_END came {ends} times")


@SHOOT.should(
    "SHOOT_FRAME {exposure}: a motor without blur stays at rest",
    f"{_BLUR}; note 7.1",
    exposure=_EXPOSURES,
    needs=_two,
)
@SHOOT2.should(
    "SHOOT_FRAME2 {exposure}: a motor without blur stays at rest",
    _BLUR,
    exposure=_TURNS,
    needs=_two,
)
def _still(bench: Bench, exposure: Exposure | Turn):
    shot = exposure.shoot(bench)
    if any(seen.steps[1] != shot.waits[1] for seen in shot.samples):
        raise Failed("motor 2 moved although it does not blur")


# ---- SHOOT_FRAME


@SHOOT.must(
    "SHOOT_FRAME {exposure}: the blur takes the exposure",
    "MSG_RT_SHOOT_FRAME: EXPOSURE TIME, BLUR PERCENT; note 7.1",
    exposure=_EXPOSURES,
)
def _window(bench: Bench, exposure: Exposure):
    half = 0.8 * exposure.blur / 2000
    first, last = exposure.place(0.5 - half), exposure.place(0.5 + half)
    _span(exposure.shoot(bench), first, last, 0.8 * exposure.ms / 1000)


@SHOOT.should(
    "SHOOT_FRAME: a motor in the list without its blur flag does not move",
    "MSG_MOTOR_CONFIGURE: 0x02 blur enabled; note 7.1",
    needs=_two,
)
def _listed(bench: Bench):
    home = bench.home
    request = _shoot(
        _FRAME, True, 300, 1000, (1, home[0] + _A, home[0] + _B), (2, home[1], home[1] + 90)
    )
    shot = _shot(bench, request)
    if any(seen.steps[1] != shot.waits[1] for seen in shot.samples):
        raise Failed("motor 2 moved, whose blur flag is not set")


# ---- SHOOT_FRAME2


@SHOOT2.must(
    "SHOOT_FRAME2 {turn}: a turn lasts its time",
    "MSG_RT_SHOOT_FRAME2: Open, close shutter time, expressed as angle; note 7.2",
    turn=_TURNS,
)
def _lasts(bench: Bench, turn: Turn):
    """A turn lasts exposure x 360 / (CLOSE - OPEN). From a tenth to nine tenths of the distance a
    device takes 0.7 of it (with ramps inside the turn) to 0.8 (without)."""
    seconds = turn.ms / 1000 * 360 / (turn.closes - turn.opens)
    _span(turn.shoot(bench), _part(_A, 0.1, _B), _part(_A, 0.9, _B), 0.75 * seconds, 0.15)


@SHOOT2.should("SHOOT_FRAME2 {turn}: waits on POS A", "note 7.3", turn=_TURNS)
def _waits(bench: Bench, turn: Turn):
    if (found := turn.shoot(bench).waits[0]) != _A:
        raise Failed(f"motor 1 waits at {found}, POS A is {_A}")


@SHOOT2.should("SHOOT_FRAME2 {turn}: ends on POS B", "note 7.3", turn=_TURNS)
def _rests(bench: Bench, turn: Turn):
    if (found := turn.shoot(bench).samples[-1].steps[0]) != _B:
        raise Failed(f"motor 1 is at {found} when RT_END comes, POS B is {_B}")


@SHOOT2.should(
    "SHOOT_FRAME2 without pairs: A and B are half a frame before and after",
    "The sets of motor numbers and positions are optional; note 7.2",
)
def _from_path(bench: Bench):
    path = bench.path(1)
    a = (path[_FRAME - 2] + path[_FRAME - 1]) / 2 - bench.home[0]
    b = (path[_FRAME - 1] + path[_FRAME]) / 2 - bench.home[0]
    shot = _shot(bench, _shoot2(_FRAME, 600, 0, 360))
    for found, wanted, where in ((shot.waits[0], a, "A"), (shot.samples[-1].steps[0], b, "B")):
        if abs(found - wanted) > 3:
            raise Failed(f"POS {where} by the path is about {wanted:.0f}, motor 1 was at {found}")


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


def _open_for(shot: Shot, exposure_ms: int) -> tuple[float, float]:
    """Require how long the shutter is open. Return when it opens and closes."""
    begin, end = _opened(shot, "shutter")
    if abs(end - begin - exposure_ms / 1000) > _PINS_S:
        raise Failed(
            f"the shutter was open for {(end - begin) * 1000:.1f} ms, the exposure is "
            f"{exposure_ms} ms"
        )
    return begin, end


@SHOOT.should(
    "SHOOT_FRAME {exposure}: the shutter is open for the blur",
    "MSG_RT_SHOOT_FRAME: EXPOSURE TIME; note 7.1",
    exposure=_EXPOSURES,
    needs=_pins,
)
def _shutter(bench: Bench, exposure: Exposure):
    shot = exposure.shoot(bench)
    half = exposure.blur / 2000
    for time, part in zip(_open_for(shot, exposure.ms), (0.5 - half, 0.5 + half), strict=True):
        wanted = round(exposure.place(part))
        if abs(_step_at(shot, time) - wanted) > 2:
            raise Failed(
                f"at an edge of the shutter motor 1 was at {_step_at(shot, time)}, "
                f"expected {wanted}"
            )


@SHOOT2.should(
    "SHOOT_FRAME2 {turn}: the shutter is open for the exposure",
    "MSG_RT_SHOOT_FRAME2: EXPOSURE TIME",
    turn=_TURNS,
    needs=_pins,
)
def _shutter2(bench: Bench, turn: Turn):
    _open_for(turn.shoot(bench), turn.ms)


# ---- refusals


_IN_UPLOAD = "A frame in the uploaded move; ERR_RANGE"


@SHOOT.must(
    "SHOOT_FRAME of frame {number}, outside the upload, is refused",
    f"MSG_RT_SHOOT_FRAME: {_IN_UPLOAD}",
    number=(0, FRAMES + 1),
)
def _outside(bench: Bench, number: int):
    bench.upload()
    bench.expect(_shoot(number, True, 500, 1000), spec.ERR_RANGE)


@SHOOT2.must(
    "SHOOT_FRAME2 of frame {number}, outside the upload, is refused",
    f"MSG_RT_SHOOT_FRAME2: {_IN_UPLOAD}",
    number=(0, FRAMES + 1),
)
def _outside2(bench: Bench, number: int):
    bench.upload()
    bench.expect(_shoot2(number, 500, 0, 360), spec.ERR_RANGE)


@SHOOT.must(
    "SHOOT_FRAME with motor {motor} in its list is refused",
    "MSG_RT_SHOOT_FRAME: Motor number; ERR_RANGE",
    motor=(0, 33, 255),
)
def _no_such_motor(bench: Bench, motor: int):
    bench.upload()
    bench.expect(_shoot(_FRAME, True, 500, 1000, (motor, 0, 0)), spec.ERR_RANGE)


@SHOOT2.must(
    "SHOOT_FRAME2 with motor {motor} in its list is refused",
    "MSG_RT_SHOOT_FRAME2: Motor number; ERR_RANGE",
    motor=(0, 33, 255),
)
def _no_such_motor2(bench: Bench, motor: int):
    bench.upload()
    bench.expect(_shoot2(_FRAME, 500, 0, 360, (motor, 0, 0)), spec.ERR_RANGE)


@SHOOT.should("SHOOT_FRAME while a motor moves is refused", "ERR_MOVING; note 6.1")
def _moving(bench: Bench):
    bench.upload()
    bench.expect(spec.move(1, bench.home[0] + 200))
    bench.expect(_shoot(_FRAME, True, 500, 1000), spec.ERR_MOVING)
    bench.idle()
    bench.return_home()


@SHOOT.should("SHOOT_FRAME before UPLOAD_MOVE_END is refused", "note 5.4")
def _nothing(bench: Bench):
    bench.expect(spec.begin(1, FRAMES))
    bench.refused(_shoot(_FRAME, True, 500, 1000))


@SHOOT.should("STOP_ALL ends an exposure, with RT_END", "MSG_MOTOR_STOP_ALL; note 6.6")
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
