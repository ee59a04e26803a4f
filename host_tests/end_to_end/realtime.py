"""What the tests of real-time operations share: an upload with lights and triggers, what its edges
must be, and the answer to each request in each state. `python -m host_tests.end_to_end.realtime`
prints the page about these, docs/internals/realtime.md."""

import numpy as np

from framestep_tools import payloads as p
from framestep_tools.judge.judge import frame_times_ns, judge
from framestep_tools.judge.trace import Trace
from host_tests.end_to_end.session import simulated

FRAMES = 25
PING_PONG, LOOP, VIDEO, STILLS = 0x01, 0x02, 0x10, 0x20
VELOCITY, ACCELERATION = 20_000, 100_000
# A motor at constant speed and one that swings; scene frames 1 to 25
MOVE = {
    1: 100 + 60 * np.arange(FRAMES),
    2: np.round(400 * np.sin(np.arange(FRAMES) * 0.3)).astype(int),
}
LEVELS = {17: (np.arange(FRAMES) * 7 % 256).astype(int), 300: np.repeat([200, 0, 90, 90, 250], 5)}
MASK = 0b0111
# bit 3 is not in the mask
TRIGGERS = {0: 0b001, 3: 0b010, 4: 0b010, 5: 0b110, 11: 0b1001, 24: 0b100}
ALL_OFF = ("shutter", "meter", "gio1", "gio2", "gio3", "gio4")
RIG = {"outputs": [{"pin": pin} for pin in (22, 26, 27, 28)], "inputs": []}


def rig(upload_bytes=0, **settings):
    """Return a session whose motors are fast enough for MOVE, with four outputs."""
    memory = {"upload_bytes": upload_bytes} if upload_bytes else {}
    session = simulated({**RIG, **settings}, **memory)
    for motor in MOVE:
        session.speed(motor, VELOCITY, ACCELERATION).accept(p.MotorConfigure(motor, 0x03))
    return session


def upload(session, positions=None, levels=None, triggers=None, mask=MASK, start=1, frames=FRAMES):
    """Upload positions, and their lights and triggers."""
    session.accept(p.RtUploadMoveBegin(start, start + frames - 1))
    for motor, steps in (MOVE if positions is None else positions).items():
        for at in range(0, len(steps), 250):
            last = p.LAST_SECTION if at + 250 >= len(steps) else 0
            session.accept(p.RtUploadMoveAxis(motor, at | last, steps[at : at + 250]))
    for channel, row in (levels or {}).items():
        session.accept(p.RtUploadMoveDmx(channel, p.LAST_SECTION, row))
    if triggers is not None:
        session.accept(
            p.RtUploadMoveTriggers(mask, tuple(p.Trigger(i, on) for i, on in triggers.items()))
        )
    session.accept(p.RtUploadMoveEnd())


def loaded(**settings):
    """Return a session with everything uploaded."""
    session = rig(**settings)
    upload(session, levels=LEVELS, triggers=TRIGGERS)
    return session


def edges(session, signal):
    """Return [(seconds, level)] of a signal so far."""
    times, values = session.trace().signals.get(signal, (np.zeros(0), np.zeros(0, int)))
    return [(float(t) * 1e-9, int(v)) for t, v in zip(times, values, strict=True)]


def changes(session, signal):
    """Return the same without levels of no duration, which two cues of a tick may leave."""
    found = []
    for time, level in edges(session, signal):
        if found and found[-1][0] == time:
            found.pop()
        if not found or found[-1][1] != level:
            found.append((time, level))
    return found


class Levels:
    """The level of one signal over time: levels(time)."""

    def __init__(self, session, signal):
        times, self._values = session.trace().signals.get(signal, (np.zeros(0), np.zeros(0, int)))
        self._times = times * 1e-9

    def __call__(self, time):
        at = np.searchsorted(self._times, time, side="right")
        return int(self._values[at - 1]) if at else 0


def level_now(session, signal):
    """Return the present level of a signal."""
    return Levels(session, signal)(session.now)


def laps_seen(session):
    """Return [[(time, scene frame), …], …]: the frames in position reports, a list for each lap.

    The frame on which a lap begins is missing: the reports have its MOVE TIME before the motors
    reach it.
    """
    reported, before = [], None
    for time, message in session.events(p.Positions):
        frame = message.move_time / 1000
        if before is None or frame == before:
            before = frame
            continue
        step = frame - before
        before = frame
        if abs(step) == 1:
            if (
                not reported
                or reported[-1][-1][1] != frame - step
                or (len(reported[-1]) > 1 and reported[-1][-2][1] == frame)
            ):
                reported.append([])
            reported[-1].append((time, frame))
    return reported


def pass_trace(session, begin, end, start):
    """Return a trace of the edges between two times (s), and where the motors are at its
    begin."""
    trace = session.trace()
    cut, places = {}, {}
    for name, (times, values) in trace.signals.items():
        inside = (times >= begin * 1e9) & (times < end * 1e9)
        cut[name] = (times[inside], values[inside])
    for motor, place in start.items():
        times, signs = trace.steps(motor)
        places[motor] = int(place + signs[times < begin * 1e9].sum())
    return Trace(cut), places


def judge_lap(session, begin, end, start, positions, fps, **more):
    """Return the verdict on one lap of a loop, which has the time of its first frame."""
    trace, places = pass_trace(session, begin, end, start)
    verdict = judge(trace, positions, round(fps * 1000), places, **more)
    assert verdict.good, verdict.complaints
    return verdict


def frame_times(verdict, fps, frames=FRAMES):
    """Return when each frame was, seconds."""
    return (verdict.origin_ns + frame_times_ns(frames, round(fps * 1000))) * 1e-9


def turning(first, last):
    """Return the indices of the frames from one to another in the order of play."""
    step = 1 if last >= first else -1
    return np.arange(first, last + step, step)


def go(session, request):
    """Prepare a run, forget events, start. Return where the motors waited."""
    session.ready(request)
    before = session.positions
    session.forget().accept(p.RtGo())
    return before


def to_the_end(session, seconds=20):
    """Wait for RT_END, which must be the only one. Return when it came."""
    session.until(p.RtEnd, seconds)
    ended = session.now
    session.run(0.5).wait_idle()  # on the end frame again (field note 6.11)
    assert not session.events(p.RtEnd), "RT_END came twice"
    return ended


def judged(session, before, fps=24, first=1, last=FRAMES, roll=0.5):
    """Return a verdict for each lap, each over all its frames."""
    verdicts = []
    for reported in laps_seen(session):
        backward = reported[-1][1] < reported[0][1]
        frames = turning(last, first) if backward == (last > first) else turning(first, last)
        assert [f for _, f in reported] == frames[1:].tolist()
        positions = {m: steps[frames - 1] for m, steps in MOVE.items()}
        begin = reported[0][0] - 1 / fps - roll / 2
        verdicts.append(
            judge_lap(session, begin, reported[-1][0] + roll / 2, before, positions, fps)
        )
    return verdicts


def assert_held(session, signal, row, times):
    """Assert that a signal has each frame's level from 1 ms after the frame's time until 1 ms
    before the next one's."""
    level = Levels(session, signal)
    ends = np.append(times[1:], times[-1] + np.diff(times).min())
    for i, (time, end) in enumerate(zip(times, ends, strict=True)):
        assert level(time + 0.001) == row[i] == level(end - 0.001), (signal, i)


def assert_levels(session, times, frames):
    for channel, row in LEVELS.items():
        assert_held(session, f"dmx{channel}", row[list(frames)], times)


def assert_triggers(session, times, frames):
    for bit in range(3):
        assert_held(
            session, f"gio{bit + 1}", [TRIGGERS.get(frame, 0) >> bit & 1 for frame in frames], times
        )


def camera(session):
    """Return [(begin, end)] of the shutter's openings; the meter is on for the same times."""
    shutter = changes(session, "shutter")
    assert shutter == changes(session, "meter")
    assert [v for _, v in shutter] == [1, 0] * (len(shutter) // 2)
    return [(a, b) for (a, _), (b, _) in zip(shutter[::2], shutter[1::2], strict=True)]


# Columns: a state, OperationRunner's states in it, its meaning
STATES = {
    "empty": ("IDLE", "nothing is uploaded, all motors are at rest"),
    "upload": ("IDLE", "between UPLOAD_MOVE_BEGIN and UPLOAD_MOVE_END"),
    "idle": ("IDLE", "a move is uploaded, nothing is prepared, all motors are at rest"),
    "move": (
        "IDLE, LEAVING",
        "as `idle`, but a motor moves: by MOVE, JOG, POSITION_FRAME or after a run",
    ),
    "positioning": (
        "POSITIONING",
        "RUN_MOVE, SHOOT_FRAME or SHOOT_FRAME2 is acknowledged; motors move to the start",
    ),
    "ready": ("READY", "the motors are at the start and wait for GO"),
    "run": ("STARTING, RUNNING", "a RUN_MOVE runs"),
    "next lap": (
        "POSITIONING",
        "in a loop or ping-pong, the motors move to the start of the next lap",
    ),
    "ending": ("ENDING", "a stop has ended the operation, its motors ramp down"),
    "shoot": ("STARTING, RUNNING", "a SHOOT_FRAME or SHOOT_FRAME2 runs"),
    "jog": (
        "POSITIONING, STARTING, RUNNING",
        "a JOG_ALL runs, or slows down to a frame after MOTOR_STOP or STOP_ALL",
    ),
    "estop": ("IDLE", "as `idle`, but the E-stop is pressed"),
}

# Response codes: the last two digits; OK means 0x0010 or an answer with data
#                         in the order of STATES
_ALWAYS = "OK OK OK OK OK OK OK OK OK OK OK OK"
_NEVER = "13 13 13 13 13 13 13 13 13 13 13 13"
_NO_VIRTUALS = "15 15 15 15 15 15 15 15 15 15 15 15"
_RUN = p.RtRunMove(24000, 5, 20, 500, 500)
_SWING_PAN = p.VirtConfig(2, (p.VirtualAxis(1, 1000), p.VirtualAxis(2, 1000)))

# Rows: name in the table, request, answers in the order of STATES
ANSWERS = (
    ("HI", p.Hi(), _ALWAYS),
    ("CONDITION, EXCEEDED, LOAD (framestep's own)", p.GetCondition(), _ALWAYS),
    ("", p.GetExceeded(), _ALWAYS),
    ("", p.GetLoad(), _ALWAYS),
    ("HOME (framestep's own), if no motor has `home` in the rig file", p.Home(), _NEVER),
    ("MOTOR_STATUS", p.MotorStatus(), _ALWAYS),
    ("MOTOR_GET_POSITION", p.MotorGetPosition(), _ALWAYS),
    ("DMX", p.Dmx(0, 5, [9]), _ALWAYS),
    ("GIO_OUT", p.GioOut(0), _ALWAYS),
    ("GIO_IN", p.GioIn(), _ALWAYS),
    ("GIO_CAM", p.GioCam(0), _ALWAYS),
    ("MOTOR_SET_SPEED", p.MotorSetSpeed(1, 20000, 100000), _ALWAYS),
    ("MOTOR_SET_LIMITS", p.MotorSetLimits(1, 0, 0, 0, 0), _ALWAYS),
    ("MOTOR_CONFIGURE that changes the flags of a motor of the operation", p.MotorConfigure(1, 1),
     "OK OK OK OK OK OK 12 12 12 12 12 OK"),
    ("MOTOR_CONFIGURE with the flags as they are, or for a motor outside the operation",
     p.MotorConfigure(1, 3), _ALWAYS),
    ("", p.MotorConfigure(8, 3), _ALWAYS),
    ("MOTOR_MOVE, MOTOR_JOG of a motor of the operation", p.MotorMove(1, 900),
     "OK OK OK OK OK OK 12 12 12 12 12 15"),
    ("", p.MotorJog(1, 5000, 900), "OK OK OK OK OK OK 12 12 12 12 12 15"),
    ("MOTOR_MOVE, MOTOR_JOG of another motor", p.MotorMove(8, 50),
     "OK OK OK OK OK OK OK OK OK OK OK 15"),
    ("", p.MotorJog(8, 5000, 50), "OK OK OK OK OK OK OK OK OK OK OK 15"),
    ("MOTOR_STOP", p.MotorStop(1), _ALWAYS),
    ("MOTOR_STOP_ALL", p.MotorStopAll(), _ALWAYS),
    ("MOTOR_RESET_POSITION of a moving motor, or of one of the running operation",
     p.MotorResetPosition(1, 7), "-- -- -- 12 12 -- 12 12 12 12 12 --"),
    ("MOTOR_RESET_POSITION of another motor", p.MotorResetPosition(8, 7), _ALWAYS),
    ("RT_UPLOAD_MOVE_BEGIN", p.RtUploadMoveBegin(1, 9), "OK OK OK OK OK OK 12 12 12 12 12 OK"),
    ("RT_UPLOAD_MOVE_AXIS", p.RtUploadMoveAxis(1, 0, [5]), "15 OK 15 15 15 15 12 12 12 12 12 15"),
    ("RT_UPLOAD_MOVE_DMX", p.RtUploadMoveDmx(7, 0, [5]), "15 OK 15 15 15 15 12 12 12 12 12 15"),
    ("RT_UPLOAD_MOVE_TRIGGERS", p.RtUploadMoveTriggers(1, [p.Trigger(0, 1)]),
     "15 OK 15 15 15 15 12 12 12 12 12 15"),
    ("RT_UPLOAD_MOVE_END", p.RtUploadMoveEnd(), "15 OK OK OK OK OK 12 12 12 12 12 OK"),
    ("RT_POSITION_FRAME", p.RtPositionFrame(3), "15 15 OK OK OK OK 12 12 12 12 12 15"),
    ("RT_RUN_MOVE", _RUN, "15 15 OK 12 12 OK 12 12 12 12 12 15"),
    ("RT_SHOOT_FRAME", p.RtShootFrame(9, 1, 200, 500), "15 15 OK 12 12 OK 12 12 12 12 12 15"),
    ("RT_SHOOT_FRAME2", p.RtShootFrame2(9, 200, 0, 180, [p.BlurMotor(1, 0, 50)]),
     "15 15 OK 12 12 OK 12 12 12 12 12 15"),
    ("RT_GO", p.RtGo(), "15 15 15 15 16 OK 12 12 12 12 12 15"),
    ("RT_STOP_LOOP", p.RtStopLoop(), _ALWAYS),
    ("RT_JOG_ALL", p.RtJogAll(12000, 9), "15 15 OK 12 12 16 12 12 12 12 OK 15"),
    ("VIRT_CONFIG that removes the virtual axes (type 0)", p.VirtConfig(0), _ALWAYS),
    ("VIRT_CONFIG with motors of the operation", _SWING_PAN, "OK OK OK 12 12 OK 12 12 12 12 12 OK"),
    ("VIRT_MOVE and the other virtual requests", p.VirtMove(1, 100), _NO_VIRTUALS),
    ("", p.VirtStop(1), _NO_VIRTUALS),
    ("", p.VirtJog(1, 5000, 100), _NO_VIRTUALS),
    ("", p.VirtJogOnLine(0, 100), _NO_VIRTUALS),
    ("", p.VirtGetPosition(), _NO_VIRTUALS),
    ("", p.SetVirtAimPoint(1, 0, 0, 0), _NO_VIRTUALS),
    ("MOTOR_HARD_STOP, RT_END (only the device sends them)", p.MotorHardStop(), _NEVER),
    ("", p.RtEnd(), _NEVER),
)  # fmt: skip

_NOTES = """\
Numbers are the last two hexadecimal digits of the response code: 12 is ERR_MOVING, 13 ERR_UNSUPPORTED, 15 ERR_GENERAL, 16
ERR_NOT_IN_POSITION. OK is 0x0010, or an answer with data. "--": no motor is in motion in this state; the next row applies.

The table is for firmware that has virtual axes, with none configured. Firmware without them answers 13 to all virtual requests. The table
assumes that each payload is in range. If one is not, the answer in the place of OK is 14 (ERR_RANGE), 17 or 18 (pre-roll or post-roll
past a limit), 20 or 21 (soft limit), or 22 or 23 (limit switch).

An operation is a RUN_MOVE, a SHOOT_FRAME, a SHOOT_FRAME2 or a JOG_ALL. A motor belongs to it if it has uploaded positions (or is named in
SHOOT_FRAME), is enabled, and is not under live control (a flag of CONFIGURE). From here on, SHOOT_FRAME also means SHOOT_FRAME2.

Consequences and special cases:

* In `positioning` and `ready`, MOVE and JOG are accepted and can move a motor off its start position. GO then answers 16 until the host
  has moved it back.
* POSITION_FRAME and UPLOAD_MOVE_BEGIN drop the prepared operation without RT_END, so GO then answers 15. RUN_MOVE and SHOOT_FRAME replace
  it; they are accepted only if all motors are at rest.
* In `ready`, JOG_ALL is accepted only if the motors happen to be on an uploaded frame.
* MOTOR_STOP of a motor of the operation, and STOP_ALL, end a prepared or running operation: its motors ramp down. So does the E-stop, a
  limit switch of such a motor or a [fault](../use/safety.md#what-each-fault-does). One RT_END follows for RUN_MOVE and SHOOT_FRAME, once
  all their motors are at rest. JOG_ALL sends no RT_END, however it ends.
* After MOTOR_STOP and STOP_ALL, JOG_ALL slows down and stops exactly on a frame. In the first tenth of a second its motors may be some
  steps beside the path where that has a corner. A STOP_ALL within a second of the last one, or while JOG_ALL slows down after a STOP_ALL,
  is the hard stop. JOG_ALL then also stops between frames.
* If the host disconnects or stops reading, everything stops, and no RT_END is sent.
* STOP_LOOP during a lap makes that lap the last one. If it comes while the motors go back to the loop's start, no further lap follows. If
  it comes before GO, the loop will have a single lap. Without a loop it has no effect.
* After the last lap of a RUN_MOVE, RT_END is sent. Then the motors move from the end of the post-roll to the end frame, as after
  POSITION_FRAME; the state is `move`. After a stop they stay where they are.
* From the acknowledgement of GO until RT_END, MOTOR_STATUS reports every motor of the operation as moving, also in the pauses between
  laps. A motor on its way to its start position is reported as moving from the acknowledgement of RUN_MOVE or SHOOT_FRAME until it is at
  rest there. So if the host waits until MOTOR_STATUS reports all motors at rest, GO, RUN_MOVE, SHOOT_FRAME and POSITION_FRAME do not
  answer 12. The one exception is an operation without motors.
* An operation may have no motor: a move of lights alone, or a SHOOT_FRAME in which no motor moves while the shutter is open. It is
  `ready` as soon as RUN_MOVE or SHOOT_FRAME is acknowledged. While it runs, MOTOR_STATUS reports no motor as moving, but requests get 12
  as in any run; RT_END reports the end.
* If no motor has uploaded positions, POSITION_FRAME sets lights and triggers only, and JOG_ALL answers 16.
* A device without DMX answers 13 to DMX and RT_UPLOAD_MOVE_DMX.

Positions, light levels and triggers share one memory; note 5.7 of the [protocol notes](protocol-notes.md) says how much each takes.
A section (one motor's positions, one light's levels, the triggers) that no longer fits gets ERR_RANGE (0x0014). The upload stays as it
was before that section, and can be ended and run without it.
"""  # noqa: E501

_DIAGRAM = """\
        RUN_MOVE, SHOOT_FRAME         all there          GO              another lap
    idle ------------------> positioning -----> ready -----> run, shoot ------------> next lap
     ^                            |               |            |   |  ^                |   |
     |                            | stop     stop |       stop |   |  +-- all there ---+   | stop
     |                            v               v            v   |                       |
     +-- RT_END, at rest ------ ending <----------+------------+---|-----------------------+
     |                                                             |
     +-- after a run: move <-- RT_END <----------------------------+ end

    idle --- JOG_ALL ---> jog --- at rest on a frame, no RT_END ---> idle
"""


def expected(state):
    """[(request, answer)] in a state."""
    column = list(STATES).index(state)
    return [(request, answers.split()[column]) for _, request, answers in ANSWERS]


def page():
    """docs/internals/realtime.md."""
    lines = ["# Real-time operations: states and answers", ""]
    lines += [
        "`host_tests/end_to_end/realtime.py` makes this page; tests check that the "
        "firmware does what it says.",
        "",
    ]
    lines += [
        _DIAGRAM,
        "| state | [in the code](../../ARCHITECTURE.md#what-happens-to-a-run_move) | meaning |",
        "|---|---|---|",
    ]
    lines += [
        f"| `{state}` | {inside} | {meaning} |" for state, (inside, meaning) in STATES.items()
    ]
    lines += ["", "| message | " + " | ".join(STATES) + " |", "|---" * (len(STATES) + 1) + "|"]
    lines += [
        f"| {name} | " + " | ".join(answers.split()) + " |" for name, _, answers in ANSWERS if name
    ]
    return "\n".join([*lines, "", _NOTES])


if __name__ == "__main__":
    print(page(), end="")
