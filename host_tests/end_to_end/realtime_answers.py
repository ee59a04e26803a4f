"""Answers to each message in each state of the real-time operations: the source of
docs/internals/realtime.md.

python -m host_tests.end_to_end.realtime_answers > docs/internals/realtime.md
"""

from framestep_tools import payloads as p

# Columns: a state and its meaning
STATES = {
    "empty": "nothing is uploaded, all at rest",
    "upload": "between UPLOAD_MOVE_BEGIN and UPLOAD_MOVE_END",
    "idle": "a move is uploaded, nothing prepared, all at rest",
    "move": "the same while a motor moves: by MOVE, JOG or POSITION_FRAME",
    "way": "RUN_MOVE, SHOOT_FRAME or SHOOT_FRAME2 acknowledged, motors move to its start",
    "ready": "the motors are at the start and wait for GO",
    "run": "a RUN_MOVE runs",
    "back": "a loop goes back to its start",
    "stop": "a RUN_MOVE ramps down after STOP or STOP_ALL",
    "shoot": "a SHOOT_FRAME or SHOOT_FRAME2 runs",
    "jog": "a JOG_ALL runs, or lands after STOP or STOP_ALL",
    "estop": "a move is uploaded, the E-stop is held",
}

# Response codes: the last two digits; OK means 0x0010 or an answer with data
#                         empty upload idle move way ready run back stop shoot jog estop
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
    ("HOME (framestep's own), where no motor has `home`", p.Home(), _NEVER),
    ("MOTOR_STATUS", p.MotorStatus(), _ALWAYS),
    ("MOTOR_GET_POSITION", p.MotorGetPosition(), _ALWAYS),
    ("DMX", p.Dmx(0, 5, [9]), _ALWAYS),
    ("GIO_OUT", p.GioOut(0), _ALWAYS),
    ("GIO_IN", p.GioIn(), _ALWAYS),
    ("GIO_CAM", p.GioCam(0), _ALWAYS),
    ("MOTOR_SET_SPEED", p.MotorSetSpeed(1, 20000, 100000), _ALWAYS),
    ("MOTOR_SET_LIMITS", p.MotorSetLimits(1, 0, 0, 0, 0), _ALWAYS),
    (
        "MOTOR_CONFIGURE: other flags of a motor that has a part",
        p.MotorConfigure(1, 1),
        "OK OK OK OK OK OK 12 12 12 12 12 OK",
    ),
    ("MOTOR_CONFIGURE: the same flags, or another motor", p.MotorConfigure(1, 3), _ALWAYS),
    ("", p.MotorConfigure(8, 3), _ALWAYS),
    (
        "MOTOR_MOVE, MOTOR_JOG: a motor that has a part",
        p.MotorMove(1, 900),
        "OK OK OK OK OK OK 12 12 12 12 12 15",
    ),
    ("", p.MotorJog(1, 5000, 900), "OK OK OK OK OK OK 12 12 12 12 12 15"),
    (
        "MOTOR_MOVE, MOTOR_JOG: another one",
        p.MotorMove(8, 50),
        "OK OK OK OK OK OK OK OK OK OK OK 15",
    ),
    ("", p.MotorJog(8, 5000, 50), "OK OK OK OK OK OK OK OK OK OK OK 15"),
    ("MOTOR_STOP", p.MotorStop(1), _ALWAYS),
    ("MOTOR_STOP_ALL", p.MotorStopAll(), _ALWAYS),
    (
        "MOTOR_RESET_POSITION: a motor that moves, or has a part in what runs",
        p.MotorResetPosition(1, 7),
        "-- -- -- 12 12 -- 12 12 12 12 12 --",
    ),
    ("MOTOR_RESET_POSITION: another one", p.MotorResetPosition(8, 7), _ALWAYS),
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
    ("VIRT_CONFIG: none", p.VirtConfig(0), _ALWAYS),
    ("VIRT_CONFIG: motors that have a part", _SWING_PAN, "OK OK OK 12 12 OK 12 12 12 12 12 OK"),
    ("VIRT_MOVE and the other virtual requests", p.VirtMove(1, 100), _NO_VIRTUALS),
    ("", p.VirtStop(1), _NO_VIRTUALS),
    ("", p.VirtJog(1, 5000, 100), _NO_VIRTUALS),
    ("", p.VirtJogOnLine(0, 100), _NO_VIRTUALS),
    ("", p.VirtGetPosition(), _NO_VIRTUALS),
    ("", p.SetVirtAimPoint(1, 0, 0, 0), _NO_VIRTUALS),
    ("MOTOR_HARD_STOP, RT_END: for the device to send", p.MotorHardStop(), _NEVER),
    ("", p.RtEnd(), _NEVER),
)

_NOTES = """\
A number is the last two digits of a response code: 12 is ERR_MOVING, 13 ERR_UNSUPPORTED, 15 ERR_GENERAL, 16
ERR_NOT_IN_POSITION. OK is 0x0010, or an answer with data. "--": no motor is in motion in this state; the next row applies.

The table describes a device that has virtual axes, but none configured; one without them answers 13 to all virtual requests. It
assumes that each payload is in range. Where it says OK, a payload out of range gets 14, 17, 18 or 20 to 23.

An operation is a RUN_MOVE, a SHOOT_FRAME, a SHOOT_FRAME2 or a JOG_ALL. A motor has a part in it if it has uploaded positions (or is named
in SHOOT_FRAME), is enabled, and is not under live control (a flag of CONFIGURE). SHOOT_FRAME stands for both below.

What follows, and special cases:

* In `way` and `ready`, MOVE and JOG may lead a motor away from its start. GO then answers 16 until the host has moved it back.
* POSITION_FRAME and UPLOAD_MOVE_BEGIN drop the prepared operation, so GO answers 15. RUN_MOVE and SHOOT_FRAME, which are accepted only
  when all motors are at rest, replace it.
* In `ready`, JOG_ALL is accepted only if the motors happen to be on an uploaded frame.
* STOP of a motor that has a part, and STOP_ALL, end a prepared or running operation: its motors ramp down. Once all are at rest, one
  RT_END follows for RUN_MOVE and SHOOT_FRAME, none for JOG_ALL.
* A stopped JOG_ALL ends on a whole frame. A second STOP_ALL within a second makes a hard stop, and JOG_ALL then stops anywhere.
* If the host is lost, everything stops without RT_END.
* STOP_LOOP during a lap makes that lap the last one. If it comes while the motors go back to the loop's start, no further lap follows. If
  it comes before GO, the loop will have a single lap. Without a loop it has no effect.
* After the last lap of a RUN_MOVE, RT_END is sent and the motors go to the end frame's position, as POSITION_FRAME would send them. The
  state is then `move`. After a STOP they stay where they are.
* From the acknowledgement of GO until RT_END, MOTOR_STATUS reports every motor that has a part as moving, also in the pauses between
  laps. A motor on its way to the start is reported as moving from the acknowledgement of RUN_MOVE or SHOOT_FRAME until it is at rest
  there. So a host that waits until no motor is reported as moving gets no 12 from GO, RUN_MOVE, SHOOT_FRAME and POSITION_FRAME.
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
                 prepare              all there               GO
    idle --------------------> way -------------> ready -------------> run, shoot, jog
     ^                          |                   |                   |   |     ^
     |                          | stop              | stop         stop |   | end | another lap
     |                          v                   v                   v   v     |
     +---- RT_END, at rest --- stop <---------------+-------------------+  back --+
     +---- RT_END ------------------------------------------------------------+
"""


def expected(state):
    """[(request, answer)] in a state."""
    column = list(STATES).index(state)
    return [(request, answers.split()[column]) for _, request, answers in ANSWERS]


def page():
    """docs/internals/realtime.md."""
    lines = ["# Real-time operations: states and answers", ""]
    lines += [
        "This page is made by `host_tests/end_to_end/realtime_answers.py`; "
        "tests hold the firmware to it.",
        "",
    ]
    lines += [_DIAGRAM, "| state | |", "|---|---|"]
    lines += [f"| `{state}` | {meaning} |" for state, meaning in STATES.items()]
    lines += ["", "| message | " + " | ".join(STATES) + " |", "|---" * (len(STATES) + 1) + "|"]
    lines += [
        f"| {name} | " + " | ".join(answers.split()) + " |" for name, _, answers in ANSWERS if name
    ]
    return "\n".join([*lines, "", _NOTES])


if __name__ == "__main__":
    print(page(), end="")
