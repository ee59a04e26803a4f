"""Lights, general outputs, the camera's outputs, and outputs of an uploaded move.

From outside only DMX STATUS and answers are visible. If a trace shows the pins, they are judged.
"""

import struct
from collections.abc import Callable

from ...judge.trace import Edge
from .. import spec
from ..bench import FRAMES, Bench
from ..kit import Subject, once, only_if
from ..link import Failed
from ..spec import Request

_FPS = 12
_FRAME_S = 0.025  # lights are sent about forty times a second
_DMX = "MSG_DMX"


def _lights(bench: Bench) -> bool:
    return bench.hello.lights > 0


def _outputs(bench: Bench) -> bool:
    return bench.hello.outputs > 0


def _runs(bench: Bench) -> bool:
    return bool(bench.hello.can & spec.CAN_RUN) and bench.hello.motors > 0


def _has_camera(bench: Bench) -> bool:
    return bool(bench.hello.can & (spec.CAN_SHOOT | spec.CAN_CAMERA))


def _plays(bench: Bench) -> bool:
    return _runs(bench) and bench.hello.lights > 1


# For --full only: nobody knows what is connected to lights and outputs. OUTPUTS needs a trace, and
# SHOWN one that has light levels.
LIGHTS = Subject("lights", full=True)
OUTPUTS = LIGHTS.where(lambda bench: bench.pins is not None)
SHOWN = LIGHTS.where(lambda bench: bench.hello.lights and _levels_show(bench))


@once
def _levels_show(bench: Bench) -> bool:
    """Return whether the trace shows a change of a level."""
    if not bench.pins:
        return False
    _dark(bench)
    edges = _seen(bench, _dmx(0, 1, *[9] * bench.hello.lights))
    _dark(bench)
    return any(name.startswith("dmx") for _, name, _ in edges)


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


@LIGHTS.must(
    "DMX of {make} is taken",
    f"{_DMX}: START CHANNEL, 1-512; MSG_HI: DMX COUNT",
    make={
        "channel 1": lambda b: _dmx(0, 1, 0),
        "the last channel": lambda b: _dmx(0, b.hello.lights, 0),
        "every channel at once": lambda b: _dmx(0, 1, *bytes(b.hello.lights)),
        "several channels": lambda b: _dmx(0, 1, *bytes(min(5, b.hello.lights))),
    },
    needs=_lights,
)
def _dmx_taken(bench: Bench, make: Callable[[Bench], Request]):
    bench.expect(make(bench))


@LIGHTS.must(
    "DMX of {make} is refused",
    f"{_DMX}: START CHANNEL, 1-512; ERR_RANGE",
    make={
        "channel 0": lambda b: _dmx(0, 0, 0),
        "channel DMX COUNT + 1": lambda b: _dmx(0, b.hello.lights + 1, 0),
        "channel 65535": lambda b: _dmx(0, 0xFFFF, 0),
        "two levels from the last channel on": lambda b: _dmx(0, b.hello.lights, 0, 0),
    },
    needs=_lights,
)
def _dmx_refused(bench: Bench, make: Callable[[Bench], Request]):
    bench.expect(make(bench), spec.ERR_RANGE)


@LIGHTS.must(
    "RAMP 0: no light is adjusting", f"{_DMX}: 0=immediate; MSG_MOTOR_STATUS", needs=_lights
)
def _at_once(bench: Bench):
    bench.expect(_dmx(0, 1, 200))
    adjusting = bench.lit()
    _dark(bench)
    if adjusting:
        raise Failed("after a DMX message with RAMP 0, DMX STATUS is not 0")


@LIGHTS.must(
    "RAMP 1: DMX STATUS is 1 while a light ramps, then 0",
    f"{_DMX}: ramp the light value; MSG_MOTOR_STATUS: 1=DMX adjusting",
    needs=_lights,
)
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


@LIGHTS.must("lights do not set MOTOR STATUS", "MSG_MOTOR_STATUS", needs=_lights)
def _unmoved(bench: Bench):
    bench.expect(_dmx(1, 1, 200))
    moving = bench.moving()
    _dark(bench)
    if moving:
        raise Failed("a ramp of a light sets the bits of motors")


@SHOWN.must(
    "DMX {row} on these channels and no others",
    f"{_DMX}: LIGHT VALUE for START CHANNEL",
    rows={
        "1 shows 1 levels": (1, b"\xff"),
        "17 shows 3 levels": (17, b"\xff\1\2"),
        "100 shows 3 levels": (100, b"\5\0\6"),
        "512 shows 1 levels": (512, b"\x80"),
    },
)
def _shown(bench: Bench, channel: int, levels: bytes):
    only_if(bench.hello.lights >= channel + len(levels) - 1)
    _dark(bench)
    edges = _seen(bench, _dmx(0, channel, *levels))
    _dark(bench)
    wanted = {f"dmx{channel + i}": level for i, level in enumerate(levels) if level}
    found = {name: value for _, name, value in edges if name.startswith("dmx")}
    if found != wanted:
        raise Failed(f"the lights show {found}, asked for were {wanted}")


@SHOWN.must("a ramp goes up in small steps", f"{_DMX}: ramp the light value")
def _slope(bench: Bench):
    _dark(bench)
    edges = _seen(bench, _dmx(1, 3, 200), seconds=1.5)
    _dark(bench)
    levels = [value for _, name, value in edges if name == "dmx3"]
    if levels != sorted(levels) or levels[-1:] != [200] or len(levels) < 5:
        raise Failed(f"a ramp to 200 showed the levels {levels}")


# ---- outputs


@OUTPUTS.must(
    "GIO_OUT {bit} and no other",
    "MSG_GIO_OUT; note 8.3",
    bit={
        "0x1 switches output 1": 0,
        "0x2 switches output 2": 1,
        "0x4 switches output 3": 2,
        "0x8 switches output 4": 3,
    },
)
def _bit(bench: Bench, bit: int):
    only_if(bench.hello.outputs > bit)
    bits = 1 << bit
    edges = _seen(bench, _gio(0), _gio(bits))
    bench.expect(_gio(0))
    wanted = [f"gio{i + 1}" for i in range(bench.hello.outputs) if bits >> i & 1]
    found = sorted(name for _, name, value in edges if name.startswith("gio") and value)
    if found != sorted(wanted):
        raise Failed(f"GIO_OUT 0x{bits:X} switched {found or 'nothing'}, expected {wanted}")


@LIGHTS.must("GIO_OUT is acknowledged", "MSG_GIO_OUT", needs=_outputs)
def _out_taken(bench: Bench):
    bench.expect(_gio(0))


@LIGHTS.must("GIO_CAM {flags} is acknowledged", "MSG_GIO_CAM", flags=(1, 2, 3), needs=_has_camera)
def _camera_taken(bench: Bench, flags: int):
    bench.expect(Request(spec.GIO_CAM, struct.pack("<I", flags)))
    bench.expect(Request(spec.GIO_CAM, bytes(4)))


@OUTPUTS.must(
    "GIO_CAM {row}",
    "MSG_GIO_CAM: GIO_CAM_SHUTTER 0x0001, GIO_CAM_METER 0x0002",
    rows={"1 switches the shutter": (1, "shutter"), "2 switches the meter": (2, "meter")},
    needs=_has_camera,
)
def _camera(bench: Bench, flag: int, signal: str):
    off = Request(spec.GIO_CAM, bytes(4))
    edges = _seen(bench, off, Request(spec.GIO_CAM, struct.pack("<I", flag)))
    bench.expect(off)
    on = {name for _, name, value in edges if name in ("shutter", "meter") and value}
    if on != {signal}:
        raise Failed(f"GIO_CAM {flag} switched on {sorted(on) or 'nothing'}, not the {signal}")


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
        struct.pack("<IiiIIBIHHH", _FPS * 1000, 1, FRAMES, 300, 200, sync, bloop, 0, 150, flags),
    )


@once
def _played(bench: Bench, sync: int, bloop: int, flags: int) -> tuple[list[Edge], float]:
    """Return the edges from GO to RT_END and the time of the first frame. Played only once."""
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
    return edges, _first_frame(bench, edges)


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


@SHOWN.must(
    "SYNC DMX 1: uploaded levels are shown with their frames",
    "MSG_RT_RUN_MOVE: SYNC DMX; MSG_RT_UPLOAD_MOVE_DMX",
    needs=_plays,
)
def _synced(bench: Bench):
    edges, start = _played(bench, 1, 0, 0)
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


@SHOWN.must(
    "SYNC DMX 0: lights stay as they are", "MSG_RT_RUN_MOVE: 0=don't play DMX", needs=_plays
)
def _not_synced(bench: Bench):
    edges, _ = _played(bench, 0, 0, 0)
    if any(name.startswith("dmx") for _, name, _ in edges):
        raise Failed("a run with SYNC DMX 0 changed lights")


@OUTPUTS.must(
    "triggers are on in their frames and off in the others",
    "MSG_RT_UPLOAD_MOVE_TRIGGERS: Only sends frame/value pairs where one or more triggers is on",
    needs=lambda b: _plays(b) and _outputs(b),
)
def _switched(bench: Bench):
    edges, start = _played(bench, 1, 0, 0)
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


@OUTPUTS.must(
    "BLOOP LOCATION is on for BLOOP TIME from the first frame",
    "MSG_RT_RUN_MOVE: BLOOP LOCATION, BLOOP TIME; note 6.7",
    needs=lambda b: _runs(b) and _outputs(b),
)
def _bloop(bench: Bench):
    edges, start = _played(bench, 0, 1, 0)
    found = [(time * 1e-9, value) for time, name, value in edges if name == "gio1"]
    if [value for _, value in found] != [1, 0]:
        raise Failed(f"output 1 was switched {len(found)} times, a bloop is once on and off")
    (on, _), (off, _) = found
    if not 0.1 < off - on < 0.25:
        raise Failed(f"a bloop of 150 ms took {1000 * (off - on):.0f} ms")
    if abs(on - start) > 0.05:
        raise Failed(f"the bloop began {1000 * (on - start):+.0f} ms from the first frame")


@OUTPUTS.must(
    "camera flag {row} pulses",
    "MSG_RT_RUN_MOVE: FLAGS 0x10, 0x20; note 6.9",
    rows={
        "0x10, video: at start and stop: 2": (0x10, 2),
        f"0x20, stills: {FRAMES}": (0x20, FRAMES),
    },
    needs=lambda b: _runs(b) and b.hello.can & spec.CAN_CAMERA,
)
def _camera_run(bench: Bench, flags: int, count: int):
    edges, _ = _played(bench, 0, 0, flags)
    pulses = [time for time, name, value in edges if name == "shutter" and value]
    if len(pulses) != count:
        raise Failed(f"the shutter was switched on {len(pulses)} times, expected {count}")


@LIGHTS.must(
    "UPLOAD_MOVE_DMX {data} is refused",
    "MSG_RT_UPLOAD_MOVE_DMX; ERR_RANGE; note 5.3",
    data={
        "of channel 0": struct.pack("<HIB", 0, 0, 0),
        "of channel 513": struct.pack("<HIB", 513, 0, 0),
        "past the range": struct.pack("<HIB", 1, FRAMES, 0),
    },
    needs=lambda b: _runs(b) and _lights(b),
)
def _bad(bench: Bench, data: bytes):
    bench.expect(spec.begin(1, FRAMES))
    bench.expect(Request(spec.UPLOAD_DMX, data), spec.ERR_RANGE)
