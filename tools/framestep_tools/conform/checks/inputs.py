"""General inputs, limit switches and the E-stop, pressed by hand or by the simulator.

Nothing says which level of an input counts as on, so only its change is judged.
"""

import struct
from typing import NamedTuple

from .. import spec
from ..bench import Bench
from ..kit import Subject
from ..link import Failed
from ..spec import Request

_REPORT_S = 0.5
_V, _A = 500, 4000
_SLOW_V = 30  # for slow hands
_WAY = 900  # steps; at most half of them if the switch acts


INPUTS = Subject("inputs", lambda bench: bench.hands is not None)


def _inputs(bench: Bench) -> bool:
    return bench.hello.inputs > 0


def _switches(bench: Bench) -> bool:
    return bench.hello.limits > 0 and bench.hello.motors > 0


def _motors(bench: Bench) -> bool:
    return bench.hello.motors > 0


def _has_estop(bench: Bench) -> bool:
    return _motors(bench) and bench.hands is not None and bench.hands.has("E-stop")


def _press(bench: Bench, what: str, on: bool) -> None:
    assert bench.hands
    bench.hands.press(what, on)


# ---- general inputs


def _levels(bench: Bench) -> int:
    data = bench.data(spec.GIO_IN)
    if len(data) != 4:
        raise Failed(f"GIO_IN has {len(data)} bytes")
    return int.from_bytes(data, "little")


def _unasked(bench: Bench) -> list[int]:
    return [
        int.from_bytes(r.frame.payload[:4], "little")
        for r in bench.link.reports
        if r.frame.type == spec.GIO_IN
    ]


@INPUTS.must(
    "GIO_IN has the bit of an input that is pressed", "MSG_GIO_IN; note 8.3", needs=_inputs
)
def _changed(bench: Bench):
    before = _levels(bench)
    _press(bench, "input 1", True)
    bench.link.pump(_REPORT_S)
    pressed = _levels(bench)
    _press(bench, "input 1", False)
    bench.link.pump(_REPORT_S)
    after = _levels(bench)
    if pressed ^ before != 1:
        raise Failed(f"with input 1 pressed GIO_IN went from 0x{before:X} to 0x{pressed:X}")
    if after != before:
        raise Failed(f"released, GIO_IN says 0x{after:X}, before it was 0x{before:X}")


@INPUTS.must(
    "each change of an input is reported once, unasked",
    "MSG_GIO_IN: send this message, unsolicited, any time the inputs change",
    needs=_inputs,
)
def _reported(bench: Bench):
    bench.link.reports.clear()
    changes = []
    for on in (True, False):
        _press(bench, "input 1", on)
        bench.link.pump(_REPORT_S)
        changes.append((_unasked(bench), _levels(bench)))
        bench.link.reports.clear()
    for messages, level in changes:
        if messages != [level]:
            raise Failed(
                f"a change of an input is reported as {[hex(m) for m in messages] or 'nothing'}, "
                f"expected one message of 0x{level:X}"
            )


@INPUTS.should(
    "GIO_IN has no bits of missing inputs", "MSG_GIO_IN; MSG_HI: GIO INPUT COUNT", needs=_inputs
)
def _range(bench: Bench):
    if (levels := _levels(bench)) >> bench.hello.inputs:
        raise Failed(f"GIO_IN says 0x{levels:X}, there are {bench.hello.inputs} inputs")


# ---- hardware limits


def _set(bench: Bench, hw_set: int, motor: int = 1) -> None:
    bench.expect(Request(spec.SET_LIMITS, struct.pack("<BBiBiB", motor, 0, 0, 0, 0, hw_set)))


def _hard_stops(bench: Bench) -> list[bytes]:
    return [r.frame.payload for r in bench.link.reports if r.frame.type == spec.HARD_STOP]


def _run_into(bench: Bench, limit: "Limit") -> int:
    """Press a switch while motor 1 moves. Return where it comes to rest."""
    _set(bench, 0x81 if limit.swapped else 1)
    _interrupted(bench, limit.switch, limit.sign * _WAY)
    return (bench.positions().steps[0] - bench.home[0]) * limit.sign


def _interrupted(bench: Bench, what: str, steps: int) -> None:
    """Press a switch while motor 1 moves, and wait for rest."""
    assert bench.hands
    bench.hands.ready(what)
    bench.expect(spec.speed(1, _SLOW_V if bench.hands.slow else _V, _A))
    bench.link.reports.clear()
    bench.expect(spec.move(1, bench.home[0] + steps))
    bench.link.pump(0.4)
    _press(bench, what, True)
    bench.link.pump(0.05)
    bench.idle(1.2 * _WAY / _SLOW_V if bench.hands.slow else 3)
    bench.expect(spec.speed(1, _V, _A))


def _is_stopped(bench: Bench, steps: int) -> None:
    """Raise Failed if the motion was not cut short."""
    if steps > (_WAY - 5 if bench.hands and bench.hands.slow else _WAY / 2):
        raise Failed(f"with its switch pressed on the way the motor went {steps} steps")


class Limit(NamedTuple):
    """A limit of motor 1, by the direction that leads to it."""

    sign: int
    swapped: bool

    def __str__(self) -> str:
        return f"{'upper' if self.sign > 0 else 'lower'} limit{', swapped' * self.swapped}"

    @property
    def switch(self) -> str:
        return f"{'upper' if (self.sign > 0) != self.swapped else 'lower'} limit 1"


_STRAIGHT = (Limit(1, False), Limit(-1, False))
_SWAPPED = (Limit(1, True), Limit(-1, True))
_LIMITS = (*_STRAIGHT, *_SWAPPED)


def _freed(check):
    """Wrap a check: release the switch afterwards, and bring the motor back."""

    def run(bench: Bench, limit: Limit):
        try:
            check(bench, limit)
        finally:
            _press(bench, limit.switch, False)
            bench.link.pump(0.2)
            bench.prepare()
            bench.return_home()

    return run


@INPUTS.must(
    "{limit}: its switch stops the motor",
    "MSG_MOTOR_SET_LIMITS: HW SET; note 8.4",
    limit=_STRAIGHT,
    needs=_switches,
)
@INPUTS.must(
    "{limit}: its switch stops the motor",
    "MSG_MOTOR_SET_LIMITS: HW SET, 0x80 swaps high/low; note 8.4",
    limit=_SWAPPED,
    needs=_switches,
)
@_freed
def _stops(bench: Bench, limit: Limit):
    _is_stopped(bench, _run_into(bench, limit))


@INPUTS.should(
    "{limit}: HARD_STOP says which and whose",
    "MSG_MOTOR_HARD_STOP: when a limit has been hit",
    limit=_LIMITS,
    needs=_switches,
)
@_freed
def _reason(bench: Bench, limit: Limit):
    _run_into(bench, limit)
    wanted = bytes((1 if limit.sign > 0 else 2, 1))
    if (found := _hard_stops(bench)) != [wanted]:
        raise Failed(
            f"HARD_STOP came as {[m.hex() for m in found] or 'nothing'}, "
            f"expected {wanted.hex()} once"
        )


@INPUTS.must(
    "{limit}: a MOVE further is refused",
    "ERR_HARD_UP, ERR_HARD_LOW; note 8.4",
    limit=_LIMITS,
    needs=_switches,
)
@_freed
def _further(bench: Bench, limit: Limit):
    at = _run_into(bench, limit)
    home = bench.home[0]
    code = spec.ERR_HARD_UP if limit.sign > 0 else spec.ERR_HARD_LOW
    bench.expect(spec.move(1, home + limit.sign * (at + 50)), code)
    bench.idle()
    bench.at(1, limit.sign * at)


@INPUTS.should("{limit}: a MOVE away is made", "note 8.4", limit=_LIMITS, needs=_switches)
@_freed
def _away(bench: Bench, limit: Limit):
    at = _run_into(bench, limit)
    bench.expect(spec.move(1, bench.home[0] + limit.sign * (at - 40)))
    bench.idle()
    bench.at(1, limit.sign * (at - 40))


@INPUTS.must(
    "a limit switch only stops the motor that it is set for",
    "MSG_MOTOR_SET_LIMITS: HW SET",
    needs=lambda b: _switches(b) and b.hello.motors > 1,
)
def _not_its_own(bench: Bench):
    """Limit set 1 belongs to motor 1, so motor 2 goes on."""
    try:
        _set(bench, 1)
        if bench.hands and bench.hands.slow:
            _press(bench, "upper limit 1", True)
        bench.expect(spec.move(2, bench.home[1] + 300))
        bench.link.pump(0.1)
        if not (bench.hands and bench.hands.slow):
            _press(bench, "upper limit 1", True)
        bench.idle()
        bench.at(2, 300)
    finally:
        _press(bench, "upper limit 1", False)
        bench.link.pump(0.2)
        bench.prepare()
        bench.return_home()


@INPUTS.must(
    "HW SET past HW LIMIT COUNT is refused", "MSG_HI: HW LIMIT COUNT; ERR_RANGE", needs=_motors
)
def _no_such_set(bench: Bench):
    last = bench.hello.limits
    request = Request(spec.SET_LIMITS, struct.pack("<BBiBiB", 1, 0, 0, 0, 0, last + 1))
    bench.expect(request, spec.ERR_RANGE)


# ---- the E-stop


def _estop(check):
    """Wrap a check: press the E-stop while motor 1 moves, and release it afterwards."""

    def run(bench: Bench):
        try:
            _interrupted(bench, "E-stop", _WAY)
            check(bench)
        finally:
            _press(bench, "E-stop", False)
            bench.link.pump(0.3)
            bench.prepare()
            bench.return_home()

    return run


@INPUTS.must("the E-stop stops the motors", "MSG_MOTOR_HARD_STOP; note 8.4", needs=_has_estop)
@_estop
def _rests(bench: Bench):
    _is_stopped(bench, bench.positions().steps[0] - bench.home[0])


@INPUTS.should(
    "the E-stop is reported by HARD_STOP 0",
    "MSG_MOTOR_HARD_STOP: REASON 0=E-Stop",
    needs=_has_estop,
)
@_estop
def _says(bench: Bench):
    if (found := _hard_stops(bench)) != [b"\0"]:
        raise Failed(f"HARD_STOP came as {[m.hex() for m in found] or 'nothing'}, expected 00 once")


@INPUTS.should("no MOVE is accepted with the E-stop pressed", "note 8.4", needs=_has_estop)
@_estop
def _holds(bench: Bench):
    at = bench.positions().steps[0]
    bench.refused(spec.move(1, bench.home[0]))
    bench.link.pump(0.2)
    if bench.positions().steps[0] != at:
        raise Failed("a motor moved with the E-stop pressed")
