"""Answers to each message in each state of the real-time operations: the source of
docs/internals/realtime.md.

python -m host_tests.end_to_end.realtime_answers > docs/internals/realtime.md
"""

from framestep_tools import payloads as p

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
    (
        "MOTOR_CONFIGURE that changes the flags of a motor of the operation",
        p.MotorConfigure(1, 1),
        "OK OK OK OK OK OK 12 12 12 12 12 OK",
    ),
    (
        "MOTOR_CONFIGURE with the flags as they are, or for a motor outside the operation",
        p.MotorConfigure(1, 3),
        _ALWAYS,
    ),
    ("", p.MotorConfigure(8, 3), _ALWAYS),
    (
        "MOTOR_MOVE, MOTOR_JOG of a motor of the operation",
        p.MotorMove(1, 900),
        "OK OK OK OK OK OK 12 12 12 12 12 15",
    ),
    ("", p.MotorJog(1, 5000, 900), "OK OK OK OK OK OK 12 12 12 12 12 15"),
    (
        "MOTOR_MOVE, MOTOR_JOG of another motor",
        p.MotorMove(8, 50),
        "OK OK OK OK OK OK OK OK OK OK OK 15",
    ),
    ("", p.MotorJog(8, 5000, 50), "OK OK OK OK OK OK OK OK OK OK OK 15"),
    ("MOTOR_STOP", p.MotorStop(1), _ALWAYS),
    ("MOTOR_STOP_ALL", p.MotorStopAll(), _ALWAYS),
    (
        "MOTOR_RESET_POSITION of a moving motor, or of one of the running operation",
        p.MotorResetPosition(1, 7),
        "-- -- -- 12 12 -- 12 12 12 12 12 --",
    ),
    ("MOTOR_RESET_POSITION of another motor", p.MotorResetPosition(8, 7), _ALWAYS),
    ("RT_UPLOAD_MOVE_BEGIN", p.RtUploadMoveBegin(1, 9), "OK OK OK OK OK OK 12 12 12 12 12 OK"),
    ("RT_UPLOAD_MOVE_AXIS", p.RtUploadMoveAxis(1, 0, [5]), "15 OK 15 15 15 15 12 12 12 12 12 15"),
    ("RT_UPLOAD_MOVE_DMX", p.RtUploadMoveDmx(7, 0, [5]), "15 OK 15 15 15 15 12 12 12 12 12 15"),
    (
        "RT_UPLOAD_MOVE_TRIGGERS",
        p.RtUploadMoveTriggers(1, [p.Trigger(0, 1)]),
        "15 OK 15 15 15 15 12 12 12 12 12 15",
    ),
    ("RT_UPLOAD_MOVE_END", p.RtUploadMoveEnd(), "15 OK OK OK OK OK 12 12 12 12 12 OK"),
    ("RT_POSITION_FRAME", p.RtPositionFrame(3), "15 15 OK OK OK OK 12 12 12 12 12 15"),
    ("RT_RUN_MOVE", _RUN, "15 15 OK 12 12 OK 12 12 12 12 12 15"),
    ("RT_SHOOT_FRAME", p.RtShootFrame(9, 1, 200, 500), "15 15 OK 12 12 OK 12 12 12 12 12 15"),
    (
        "RT_SHOOT_FRAME2",
        p.RtShootFrame2(9, 200, 0, 180, [p.BlurMotor(1, 0, 50)]),
        "15 15 OK 12 12 OK 12 12 12 12 12 15",
    ),
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
)

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
* After MOTOR_STOP and STOP_ALL, JOG_ALL slows down and stops exactly on a frame. A STOP_ALL within a second of the last one, or while
  JOG_ALL slows down after a STOP_ALL, is the hard stop. JOG_ALL then also stops between frames.
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
        "`host_tests/end_to_end/realtime_answers.py` makes this page; tests check that the "
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
