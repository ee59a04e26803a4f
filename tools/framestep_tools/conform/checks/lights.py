"""Lights, general outputs, the camera's outputs, and outputs of an uploaded move.

From outside only DMX STATUS and answers are visible. If a trace shows the pins, they are judged.
"""

import struct
from collections.abc import Callable

from ...judge.trace import Edge
from .. import spec
from ..bench import FRAMES, Bench
from ..kit import MUST, Check
from ..link import Failed
from ..spec import Request

CHECKS: list[Check] = []
_FPS = 12
_FRAME_S = 0.025  # lights are sent about forty times a second
_DMX = "MSG_DMX"


def _lights(bench: Bench) -> bool:
    return bench.hello.lights > 0


def _outputs(bench: Bench) -> bool:
    return bench.hello.outputs > 0


def _runs(bench: Bench) -> bool:
    return bool(bench.hello.can & spec.CAN_RUN) and bench.hello.motors > 0


def _reaches(channel: int) -> Callable[[Bench], bool]:
    return lambda bench: bench.hello.lights >= channel


def _has_output(number: int) -> Callable[[Bench], bool]:
    return lambda bench: bench.hello.outputs >= number


def _put(name, source, run, level=MUST, needs: Callable[[Bench], bool] = _lights, pins=False):
    """Add a check for --full only: nobody knows what is connected to lights and outputs."""

    def has(bench: Bench) -> bool:
        return needs(bench) and (bench.pins is not None or not pins)

    CHECKS.append(Check("lights", name, source, run, level, has, True))


def _put_shown(name, source, run, needs: Callable[[Bench], bool] = _lights):
    """Add a check that needs a trace with light levels; not every trace has them."""
    _put(name, source, run, MUST, lambda b: needs(b) and _levels_show(b), True)


def _levels_show(bench: Bench) -> bool:
    """Return whether the trace shows a change of a level."""
    if "levels show" not in bench.kept:
        _dark(bench)
        edges = _seen(bench, _dmx(0, 1, *[9] * bench.hello.lights)) if bench.pins else []
        _dark(bench)
        bench.kept["levels show"] = any(name.startswith("dmx") for _, name, _ in edges)
    return bench.kept["levels show"]


def _dmx(ramp: int, channel: int, *levels: int) -> Request:
    return Request(spec.DMX, struct.pack("<BH", ramp, channel) + bytes(levels))


def _gio(bits: int) -> Request:
    return Request(spec.GIO_OUT, struct.pack("<I", bits))


def _seen(bench: Bench, *requests: Request, seconds: float = 0.1) -> list[Edge]:
    """Return the edges that these requests cause."""
    bench.link.pump(0.1)
    assert bench.pins
    bench.pins.take()
    for request in requests:
        bench.expect(request)
    bench.link.pump(seconds)
    return bench.pins.take()


def _dark(bench: Bench) -> None:
    bench.expect(_dmx(0, 1, *bytes(bench.hello.lights)))


# ---- DMX

for _name, _make in (
    ("channel 1", lambda b: _dmx(0, 1, 0)),
    ("the last channel", lambda b: _dmx(0, b.hello.lights, 0)),
    ("every channel at once", lambda b: _dmx(0, 1, *bytes(b.hello.lights))),
    ("several channels", lambda b: _dmx(0, 1, *bytes(min(5, b.hello.lights)))),
):
    _put(f"DMX of {_name} is taken", f"{_DMX}: START CHANNEL, 1-512; MSG_HI: DMX COUNT",
         lambda bench, make=_make: bench.expect(make(bench)))  # fmt: skip
for _name, _make in (
    ("channel 0", lambda b: _dmx(0, 0, 0)),
    ("channel DMX COUNT + 1", lambda b: _dmx(0, b.hello.lights + 1, 0)),
    ("channel 65535", lambda b: _dmx(0, 0xFFFF, 0)),
    ("two levels from the last channel on", lambda b: _dmx(0, b.hello.lights, 0, 0)),
):
    _put(f"DMX of {_name} is refused", f"{_DMX}: START CHANNEL, 1-512; ERR_RANGE",
         lambda bench, make=_make: bench.expect(make(bench), spec.ERR_RANGE))  # fmt: skip


def _at_once(bench: Bench):
    bench.expect(_dmx(0, 1, 200))
    adjusting = bench.lit()
    _dark(bench)
    if adjusting:
        raise Failed("after a DMX message with RAMP 0, DMX STATUS is not 0")


_put("RAMP 0: no light is adjusting", f"{_DMX}: 0=immediate; MSG_MOTOR_STATUS", _at_once)


def _ramped(bench: Bench):
    _dark(bench)
    bench.expect(_dmx(1, 1, 200))
    if bench.lit() != 1:
        raise Failed("after a DMX message with RAMP 1, DMX STATUS is not 1")
    end = bench.link.clock() + 10
    while bench.lit():
        if bench.link.clock() > end:
            raise Failed("a light still ramps after 10 s")
        bench.link.pump(0.05)
    _dark(bench)


_put(
    "RAMP 1: DMX STATUS is 1 while a light ramps, then 0",
    f"{_DMX}: ramp the light value; MSG_MOTOR_STATUS: 1=DMX adjusting",
    _ramped,
)


def _unmoved(bench: Bench):
    bench.expect(_dmx(1, 1, 200))
    moving = bench.moving()
    _dark(bench)
    if moving:
        raise Failed("a ramp of a light sets the bits of motors")


_put("lights do not set MOTOR STATUS", "MSG_MOTOR_STATUS", _unmoved)


def _shown(channel: int, levels: bytes):
    def run(bench: Bench):
        _dark(bench)
        edges = _seen(bench, _dmx(0, channel, *levels))
        _dark(bench)
        wanted = {f"dmx{channel + i}": level for i, level in enumerate(levels) if level}
        found = {name: value for _, name, value in edges if name.startswith("dmx")}
        if found != wanted:
            raise Failed(f"the lights show {found}, asked for were {wanted}")

    return run


for _channel, _levels in ((1, b"\xff"), (17, b"\xff\1\2"), (100, b"\5\0\6"), (512, b"\x80")):
    _put_shown(
        f"DMX {_channel} shows {len(_levels)} levels on these channels and no others",
        f"{_DMX}: LIGHT VALUE for START CHANNEL",
        _shown(_channel, _levels),
        needs=_reaches(_channel + len(_levels) - 1),
    )


def _slope(bench: Bench):
    _dark(bench)
    edges = _seen(bench, _dmx(1, 3, 200), seconds=1.5)
    _dark(bench)
    levels = [value for _, name, value in edges if name == "dmx3"]
    if levels != sorted(levels) or levels[-1:] != [200] or len(levels) < 5:
        raise Failed(f"a ramp to 200 showed the levels {levels}")


_put_shown("a ramp goes up in small steps", f"{_DMX}: ramp the light value", _slope)

# ---- outputs


def _bits(bits: int):
    def run(bench: Bench):
        edges = _seen(bench, _gio(0), _gio(bits))
        bench.expect(_gio(0))
        wanted = [f"gio{i + 1}" for i in range(bench.hello.outputs) if bits >> i & 1]
        found = sorted(name for _, name, value in edges if name.startswith("gio") and value)
        if found != sorted(wanted):
            raise Failed(f"GIO_OUT 0x{bits:X} switched {found or 'nothing'}, expected {wanted}")

    return run


for _bit in range(4):
    _put(
        f"GIO_OUT 0x{1 << _bit:X} switches output {_bit + 1} and no other",
        "MSG_GIO_OUT; note 8.3",
        _bits(1 << _bit),
        needs=_has_output(_bit + 1),
        pins=True,
    )
_put("GIO_OUT is acknowledged", "MSG_GIO_OUT", lambda b: b.expect(_gio(0)), needs=_outputs)
for _flags in (1, 2, 3):
    _put(
        f"GIO_CAM {_flags} is acknowledged",
        "MSG_GIO_CAM",
        lambda b, flags=_flags: (
            b.expect(Request(spec.GIO_CAM, struct.pack("<I", flags))),
            b.expect(Request(spec.GIO_CAM, bytes(4))),
        )[0],
        needs=lambda b: bool(b.hello.can & (spec.CAN_SHOOT | spec.CAN_CAMERA)),
    )


def _camera(flag: int, signal: str):
    def run(bench: Bench):
        off = Request(spec.GIO_CAM, bytes(4))
        edges = _seen(bench, off, Request(spec.GIO_CAM, struct.pack("<I", flag)))
        bench.expect(off)
        on = {name for _, name, value in edges if name in ("shutter", "meter") and value}
        if on != {signal}:
            raise Failed(f"GIO_CAM {flag} switched on {sorted(on) or 'nothing'}, not the {signal}")

    return run


for _flag, _signal in ((1, "shutter"), (2, "meter")):
    _put(
        f"GIO_CAM {_flag} switches the {_signal}",
        "MSG_GIO_CAM: GIO_CAM_SHUTTER 0x0001, GIO_CAM_METER 0x0002",
        _camera(_flag, _signal),
        needs=lambda b: bool(b.hello.can & (spec.CAN_SHOOT | spec.CAN_CAMERA)),
        pins=True,
    )

# ---- with an uploaded move

_LEVELS = [10 * (i + 1) for i in range(FRAMES)]
_ON = {3: 1, 4: 1, 8: 1}  # {index of a frame: triggers}


def _program(bench: Bench) -> None:
    """Upload the move with lights on channel 2 and triggers."""
    bench.expect(spec.begin(1, FRAMES))
    bench.expect(spec.axis(1, spec.LAST, bench.path(1)))
    if bench.hello.lights > 1:
        for at, last in ((0, 0), (6, spec.LAST)):
            levels = bytes(_LEVELS[at : at + 6])
            bench.expect(Request(spec.UPLOAD_DMX, struct.pack("<HI", 2, at | last) + levels))
    if bench.hello.outputs:
        pairs = b"".join(struct.pack("<II", *pair) for pair in _ON.items())
        bench.expect(Request(spec.TRIGGERS, struct.pack("<I", 1) + pairs))
    bench.expect(Request(spec.UPLOAD_END))


def _run(sync: int, bloop: int, flags: int) -> Request:
    return Request(
        spec.RUN,
        struct.pack(
            "<IiiIIBIHHH", _FPS * 1000, 1, FRAMES, 300, 200, sync, bloop, 0, 150, flags
        ),
    )  # fmt: skip


def _played(bench: Bench, sync: int, bloop: int, flags: int = 0) -> tuple[list[Edge], float]:
    """Return the edges from GO to RT_END and the time of the first frame. Played only once."""
    key = "program", sync, bloop, flags
    if key not in bench.kept:
        if bench.hello.lights:
            _dark(bench)
        _program(bench)
        bench.expect(_run(sync, bloop, flags))
        bench.idle()
        bench.link.pump(0.1)
        assert bench.pins
        bench.pins.take()
        bench.link.reports.clear()
        bench.expect(Request(spec.GO))
        end = bench.link.clock() + FRAMES / _FPS + 4
        while not bench.ends() and bench.link.clock() < end:
            bench.link.pump(0.1)
        bench.link.pump(0.2)
        edges = bench.pins.take()
        if bench.hello.outputs:
            bench.expect(_gio(0))
        bench.idle()
        bench.return_home()
        bench.kept[key] = edges, _first_frame(bench, edges)
    return bench.kept[key]


def _first_frame(bench: Bench, edges: list[Edge]) -> float:
    """Return the time of frame 1, from the steps of motor 1 halfway between frames 6 and 7, where
    the path is steepest."""
    path = [p - bench.home[0] for p in bench.path(1)]
    middle, steps = (path[5] + path[6]) / 2, 0
    for time, name, value in edges:
        if name == "m1":
            steps += value
            if steps >= middle - path[0]:
                return time * 1e-9 - 5.5 / _FPS
    raise Failed("motor 1 was not seen to move")


def _program_needs(bench: Bench) -> bool:
    return _runs(bench) and bench.hello.lights > 1


def _synced(bench: Bench):
    edges, start = _played(bench, 1, 0)
    seen = [(time * 1e-9, value) for time, name, value in edges if name == "dmx2"]
    for i, level in enumerate(_LEVELS):
        shown = [value for time, value in seen if time <= start + (i + 0.9) / _FPS]
        if shown[-1:] != [level]:
            raise Failed(f"in frame {i + 1} channel 2 is at {shown[-1:]}, uploaded is {level}")
    for i, level in enumerate(_LEVELS[1:], 1):
        came = next(time for time, value in seen if value == level)
        if not -_FRAME_S - 0.02 < came - start - i / _FPS < _FRAME_S + 0.02:
            raise Failed(
                f"the level of frame {i + 1} came {1000 * (came - start - i / _FPS):+.0f} ms "
                "from its time"
            )


_put_shown(
    "SYNC DMX 1: uploaded levels are shown with their frames",
    "MSG_RT_RUN_MOVE: SYNC DMX; MSG_RT_UPLOAD_MOVE_DMX",
    _synced,
    needs=_program_needs,
)


def _not_synced(bench: Bench):
    edges, _ = _played(bench, 0, 0)
    if any(name.startswith("dmx") for _, name, _ in edges):
        raise Failed("a run with SYNC DMX 0 changed lights")


_put_shown(
    "SYNC DMX 0: lights stay as they are",
    "MSG_RT_RUN_MOVE: 0=don't play DMX",
    _not_synced,
    needs=_program_needs,
)


def _switched(bench: Bench):
    edges, start = _played(bench, 1, 0)
    found = [(time * 1e-9 - start, value) for time, name, value in edges if name == "gio1"]
    wanted = [(3 / _FPS, 1), (5 / _FPS, 0), (8 / _FPS, 1), (9 / _FPS, 0)]
    if [value for _, value in found] != [value for _, value in wanted]:
        raise Failed(f"output 1 was switched {len(found)} times in a run, expected {len(wanted)}")
    for (came, value), (due, _) in zip(found, wanted, strict=True):
        if abs(came - due) > 0.03:
            raise Failed(
                f"trigger 1 went {'on' if value else 'off'} {1000 * (came - due):+.0f} ms from "
                "its frame"
            )


_put(
    "triggers are on in their frames and off in the others",
    "MSG_RT_UPLOAD_MOVE_TRIGGERS: Only sends frame/value pairs where one or more triggers is on",
    _switched,
    needs=lambda b: _runs(b) and _outputs(b) and b.hello.lights > 1,
    pins=True,
)


def _bloop(bench: Bench):
    edges, start = _played(bench, 0, 1)
    found = [(time * 1e-9, value) for time, name, value in edges if name == "gio1"]
    if [value for _, value in found] != [1, 0]:
        raise Failed(f"output 1 was switched {len(found)} times, a bloop is once on and off")
    (on, _), (off, _) = found
    if not 0.1 < off - on < 0.25:
        raise Failed(f"a bloop of 150 ms took {1000 * (off - on):.0f} ms")
    if abs(on - start) > 0.05:
        raise Failed(f"the bloop began {1000 * (on - start):+.0f} ms from the first frame")


_put(
    "BLOOP LOCATION is on for BLOOP TIME from the first frame",
    "MSG_RT_RUN_MOVE: BLOOP LOCATION, BLOOP TIME; note 6.7",
    _bloop,
    needs=lambda b: _runs(b) and _outputs(b),
    pins=True,
)


def _camera_run(flags: int, count: int):
    def run(bench: Bench):
        edges, _ = _played(bench, 0, 0, flags)
        pulses = [time for time, name, value in edges if name == "shutter" and value]
        if len(pulses) != count:
            raise Failed(f"the shutter was switched on {len(pulses)} times, expected {count}")

    return run


for _flag, _count, _text in ((0x10, 2, "video: at start and stop"), (0x20, FRAMES, "stills")):
    _put(
        f"camera flag 0x{_flag:X}, {_text}: {_count} pulses",
        "MSG_RT_RUN_MOVE: FLAGS 0x10, 0x20; note 6.9",
        _camera_run(_flag, _count),
        needs=lambda b: _runs(b) and bool(b.hello.can & spec.CAN_CAMERA),
        pins=True,
    )


def _bad(request: Request):
    def run(bench: Bench):
        bench.expect(spec.begin(1, FRAMES))
        bench.expect(request, spec.ERR_RANGE)

    return run


for _text, _request in (
    ("UPLOAD_MOVE_DMX of channel 0", struct.pack("<HIB", 0, 0, 0)),
    ("UPLOAD_MOVE_DMX of channel 513", struct.pack("<HIB", 513, 0, 0)),
    ("UPLOAD_MOVE_DMX past the range", struct.pack("<HIB", 1, FRAMES, 0)),
):
    _put(f"{_text} is refused", "MSG_RT_UPLOAD_MOVE_DMX; ERR_RANGE; note 5.3",
         _bad(Request(spec.UPLOAD_DMX, _request)),
         needs=lambda b: _runs(b) and _lights(b))  # fmt: skip
