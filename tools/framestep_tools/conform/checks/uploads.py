"""Uploads, what they refuse, POSITION_FRAME and JOG_ALL."""

from .. import spec
from ..bench import FRAMES, Bench
from ..kit import MUST, SHOULD, Check
from ..link import Failed
from ..spec import Request

CHECKS: list[Check] = []


def _can(bench: Bench) -> bool:
    return bool(bench.hello.can & spec.CAN_RUN) and bench.hello.motors > 0


def _put(name, source, run, level=MUST):
    CHECKS.append(Check("uploads", name, source, run, level, _can))


def _at_frame(number: int):
    def run(bench: Bench):
        bench.upload()
        bench.expect(spec.frame(number))
        bench.idle()
        for motor in range(1, min(2, bench.hello.motors) + 1):
            bench.at(motor, bench.path(motor)[number - 1] - bench.home[motor - 1])
        move_time = bench.positions().move_time
        bench.return_home()
        if move_time != number * 1000:
            raise Failed(f"MOVE TIME at frame {number} is {move_time}, expected {number * 1000}")

    return run


for _number in range(1, FRAMES + 1):
    _put(
        f"POSITION_FRAME {_number} goes to the uploaded position",
        "MSG_RT_POSITION_FRAME; MSG_MOTOR_GET_POSITION",
        _at_frame(_number),
    )


def _repeat(bench: Bench):
    bench.expect(spec.begin(1, FRAMES))
    bench.expect(spec.axis(1, spec.LAST, [bench.home[0], bench.home[0] + 25]))
    bench.expect(Request(spec.UPLOAD_END))
    bench.expect(spec.frame(FRAMES))
    bench.idle()
    bench.at(1, 25)
    bench.return_home()


_put(
    "the last set's final position is repeated to the end",
    "MSG_RT_UPLOAD_MOVE_AXIS: the high bit",
    _repeat,
)


def _cleared(bench: Bench):
    bench.upload()
    bench.expect(spec.begin(1, FRAMES))
    bench.expect(spec.axis(1, spec.LAST, bench.path(1)))
    bench.expect(Request(spec.UPLOAD_END))
    bench.expect(spec.frame(FRAMES))
    bench.idle()
    found = bench.positions().steps[1] - bench.home[1]
    bench.return_home()
    if found:
        raise Failed(f"motor 2 went {found} steps to a frame of the upload before")


CHECKS.append(
    Check(
        "uploads",
        "BEGIN clears the move that was there",
        "MSG_RT_UPLOAD_MOVE_BEGIN: Any previously loaded move will be cleared",
        _cleared,
        MUST,
        lambda bench: _can(bench) and bench.hello.motors > 1,
    )
)


def _order(bench: Bench):
    path = bench.path(1)
    bench.expect(spec.begin(1, FRAMES))
    bench.expect(spec.axis(1, 6 | spec.LAST, path[6:]))
    bench.expect(spec.axis(1, 0, path[:6]))
    bench.expect(Request(spec.UPLOAD_END))
    for number in (3, 9):
        bench.expect(spec.frame(number))
        bench.idle()
        bench.at(1, path[number - 1] - bench.home[0])
    bench.return_home()


_put("sections may come in any order", "note 5.3", _order, SHOULD)


def _refused(request: Request, *codes: int):
    def run(bench: Bench):
        bench.upload()
        bench.expect(request, *codes)

    return run


for _number in (0, -1, FRAMES + 1, FRAMES + 100, 1_000_001):
    _put(
        f"POSITION_FRAME {_number}, outside the upload, is refused",
        "ERR_RANGE; note 5.2",
        _refused(spec.frame(_number), spec.ERR_RANGE),
    )
for _first, _last in ((0, 5), (1, FRAMES + 1), (FRAMES + 1, 1), (5, 0)):
    _put(
        f"RUN_MOVE {_first} to {_last}, outside the upload, is refused",
        "ERR_RANGE; note 5.2",
        _refused(spec.run(24, _first, _last), spec.ERR_RANGE),
    )
for _number in (0, FRAMES + 1):
    _put(
        f"JOG_ALL to frame {_number}, outside the upload, is refused",
        "ERR_RANGE; note 5.2",
        _refused(spec.jog_all(12, _number), spec.ERR_RANGE, spec.ERR_NOT_IN_POSITION),
    )
_put(
    "RUN_MOVE at 0 frames/s is refused",
    "ERR_RANGE",
    _refused(spec.run(0, 1, FRAMES), spec.ERR_RANGE),
)


def _bad(request: Request):
    def run(bench: Bench):
        bench.expect(spec.begin(1, FRAMES))
        bench.expect(request, spec.ERR_RANGE)

    return run


for _what, _request in (
    ("BEGIN with its end before its start", spec.begin(5, 4)),
    ("AXIS of motor 0", spec.axis(0, 0, [0])),
    ("AXIS of motor 33", spec.axis(33, 0, [0])),
    ("AXIS past the range", spec.axis(1, FRAMES, [0])),
    ("AXIS far past the range", spec.axis(1, 0x7FFF0000, [0])),
):
    _put(f"{_what} is refused", "ERR_RANGE; note 5.3", _bad(_request))


def _too_many(bench: Bench):
    if bench.hello.frames < 900_000:
        bench.expect(spec.begin(1, bench.hello.frames + 1), spec.ERR_RANGE)


_put("BEGIN with more frames than advertised is refused", "MSG_HI: UPLOAD FRAME COUNT", _too_many)


def _unfinished(request: Request):
    def run(bench: Bench):
        bench.expect(spec.begin(1, FRAMES))
        bench.expect(request, spec.ERR_GENERAL, spec.ERR_RANGE, spec.ERR_NOT_IN_POSITION)

    return run


for _what, _request in (
    ("POSITION_FRAME", spec.frame(1)),
    ("RUN_MOVE", spec.run(24, 1, FRAMES)),
    ("JOG_ALL", spec.jog_all(12, 2)),
):
    _put(
        f"{_what} before UPLOAD_MOVE_END is refused",
        "note 5.4; any previously loaded move will be cleared",
        _unfinished(_request),
        SHOULD,
    )


def _jogged(bench: Bench):
    bench.upload()
    bench.expect(spec.frame(2))
    bench.idle()
    bench.expect(spec.jog_all(12, 8))
    bench.idle()
    bench.at(1, bench.path(1)[7] - bench.home[0])
    bench.return_home()


_put("JOG_ALL follows the upload to its frame", "MSG_RT_JOG_ALL", _jogged)


def _astray(bench: Bench):
    bench.upload()
    bench.go(1, -9)
    bench.expect(spec.jog_all(12, 8), spec.ERR_NOT_IN_POSITION)
    bench.go(1, 0)


_put("JOG_ALL away from every frame is refused", "ERR_NOT_IN_POSITION; MSG_RT_JOG_ALL", _astray)
