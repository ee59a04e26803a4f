"""Uploads, what they refuse, POSITION_FRAME and JOG_ALL."""

from .. import spec
from ..bench import FRAMES, Bench
from ..kit import Subject
from ..link import Failed
from ..spec import Request


def _can(bench: Bench) -> bool:
    return bool(bench.hello.can & spec.CAN_RUN) and bench.hello.motors > 0


UPLOADS = Subject("uploads", _can)


@UPLOADS.must(
    "POSITION_FRAME {number} goes to the uploaded position",
    "MSG_RT_POSITION_FRAME; MSG_MOTOR_GET_POSITION",
    number=range(1, FRAMES + 1),
)
def _at_frame(bench: Bench, number: int):
    bench.upload()
    bench.expect(spec.frame(number))
    bench.idle()
    for motor in range(1, min(2, bench.hello.motors) + 1):
        bench.at(motor, bench.path(motor)[number - 1] - bench.home[motor - 1])
    move_time = bench.positions().move_time
    bench.return_home()
    if move_time != number * 1000:
        raise Failed(f"MOVE TIME at frame {number} is {move_time}, expected {number * 1000}")


@UPLOADS.must(
    "the last set's final position is repeated to the end", "MSG_RT_UPLOAD_MOVE_AXIS: the high bit"
)
def _repeat(bench: Bench):
    bench.expect(spec.begin(1, FRAMES))
    bench.expect(spec.axis(1, spec.LAST, [bench.home[0], bench.home[0] + 25]))
    bench.expect(Request(spec.UPLOAD_END))
    bench.expect(spec.frame(FRAMES))
    bench.idle()
    bench.at(1, 25)
    bench.return_home()


@UPLOADS.must(
    "BEGIN clears the move that was there",
    "MSG_RT_UPLOAD_MOVE_BEGIN: Any previously loaded move will be cleared",
    needs=lambda bench: bench.hello.motors > 1,
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


@UPLOADS.should("sections may come in any order", "note 5.3")
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


@UPLOADS.must(
    "POSITION_FRAME {number}, outside the upload, is refused",
    "ERR_RANGE; note 5.2",
    number=(0, -1, FRAMES + 1, FRAMES + 100, 1_000_001),
)
def _outside(bench: Bench, number: int):
    bench.upload()
    bench.expect(spec.frame(number), spec.ERR_RANGE)


@UPLOADS.must(
    "RUN_MOVE {row}, outside the upload, is refused",
    "ERR_RANGE; note 5.2",
    rows={
        f"{first} to {last}": (first, last)
        for first, last in ((0, 5), (1, FRAMES + 1), (FRAMES + 1, 1), (5, 0))
    },
)
def _run_outside(bench: Bench, first: int, last: int):
    bench.upload()
    bench.expect(spec.run(24, first, last), spec.ERR_RANGE)


@UPLOADS.must(
    "JOG_ALL to frame {number}, outside the upload, is refused",
    "ERR_RANGE; note 5.2",
    number=(0, FRAMES + 1),
)
def _jog_outside(bench: Bench, number: int):
    bench.upload()
    bench.expect(spec.jog_all(12, number), spec.ERR_RANGE, spec.ERR_NOT_IN_POSITION)


@UPLOADS.must("RUN_MOVE at 0 frames/s is refused", "ERR_RANGE")
def _at_rest(bench: Bench):
    bench.upload()
    bench.expect(spec.run(0, 1, FRAMES), spec.ERR_RANGE)


@UPLOADS.must(
    "{request} is refused",
    "ERR_RANGE; note 5.3",
    request={
        "BEGIN with its end before its start": spec.begin(5, 4),
        "AXIS of motor 0": spec.axis(0, 0, [0]),
        "AXIS of motor 33": spec.axis(33, 0, [0]),
        "AXIS past the range": spec.axis(1, FRAMES, [0]),
        "AXIS far past the range": spec.axis(1, 0x7FFF0000, [0]),
    },
)
def _bad(bench: Bench, request: Request):
    bench.expect(spec.begin(1, FRAMES))
    bench.expect(request, spec.ERR_RANGE)


@UPLOADS.must("BEGIN with more frames than advertised is refused", "MSG_HI: UPLOAD FRAME COUNT")
def _too_many(bench: Bench):
    if bench.hello.frames < 900_000:
        bench.expect(spec.begin(1, bench.hello.frames + 1), spec.ERR_RANGE)


@UPLOADS.should(
    "{request} before UPLOAD_MOVE_END is refused",
    "note 5.4; any previously loaded move will be cleared",
    request={
        "POSITION_FRAME": spec.frame(1),
        "RUN_MOVE": spec.run(24, 1, FRAMES),
        "JOG_ALL": spec.jog_all(12, 2),
    },
)
def _unfinished(bench: Bench, request: Request):
    bench.expect(spec.begin(1, FRAMES))
    bench.expect(request, spec.ERR_GENERAL, spec.ERR_RANGE, spec.ERR_NOT_IN_POSITION)


@UPLOADS.must("JOG_ALL follows the upload to its frame", "MSG_RT_JOG_ALL")
def _jogged(bench: Bench):
    bench.upload()
    bench.expect(spec.frame(2))
    bench.idle()
    bench.expect(spec.jog_all(12, 8))
    bench.idle()
    bench.at(1, bench.path(1)[7] - bench.home[0])
    bench.return_home()


@UPLOADS.must("JOG_ALL away from every frame is refused", "ERR_NOT_IN_POSITION; MSG_RT_JOG_ALL")
def _astray(bench: Bench):
    bench.upload()
    bench.go(1, -9)
    bench.expect(spec.jog_all(12, 8), spec.ERR_NOT_IN_POSITION)
    bench.go(1, 0)
