"""Session scripts on 32-bit MicroPython with the heap locked: the fuzzer's scripts, and extreme
values in every state. Everything must be as on CPython, with counters that start near their end.
"""

import random
import struct
from pathlib import Path

import pytest

from framestep.protocol import messages as m
from framestep_tools.client.wire import encode
from host_tests.recording import all_differences, differences, recorded
from host_tests.script import Script, parse
from host_tests.script_player import Player

FOUND = sorted((Path(__file__).parents[1] / "fuzz" / "scripts").glob("*.txt"))
EXTREME = (
    0, 1, -1, 2**15, 10**6, -(10**6), 2**29, 2**30 - 1, 2**30, -(2**30), -(2**30) - 1, 2**31 - 1,
    -(2**31),
)  # fmt: skip
MOTORS = 3
FIRST, FRAMES = 999_961, 40  # the last frame is the highest allowed


def played(script):
    """Play a script on CPython. Return its recording and its player."""
    with recorded() as recorders:
        player = Player(script)
        player.recorder = recorders[0]
        player.play()
    recording = recorders[0].finish()
    recording.test = " ".join(script.says)
    return recording, player


def words(*values):
    return struct.pack(f"<{len(values)}i", *values)


def test_what_the_fuzzer_has_found(request, runtime, tmp_path):
    """On CPython they are all judged in each run (fuzz/test_fuzz.py)."""
    scripts = {}
    for path in FOUND:
        with path.open() as file:
            scripts[path.name] = parse(file)
    names = sorted(scripts, key=lambda name: scripts[name].end)
    if request.config.getoption("repeats") != 1:
        names = names[: len(names) // 6]
    elif runtime.emulated:  # it takes minutes for the long ones
        names = names[: 2 * len(names) // 3]
    recordings = []
    for name in runtime.share(names):
        recording, _ = played(scripts[name])
        recording.test = name
        recordings.append(recording)
    found = all_differences(runtime, recordings, tmp_path)
    assert not found, "\n\n".join(found)


# ---- extreme values in every state ---------------------------------------------------------------


def upload():
    found = [(m.MSG_RT_UPLOAD_MOVE_BEGIN, words(FIRST, FIRST + FRAMES - 1))]
    for motor in (1, 2):
        steps = [round(motor * 3 * k * k / 8) for k in range(FRAMES)]
        found.append((m.MSG_RT_UPLOAD_MOVE_AXIS, bytes((motor,)) + words(0, *steps)))
    found.append((m.MSG_RT_UPLOAD_MOVE_TRIGGERS, words(-1, 2, -1, 7, 1)))
    return [
        *found,
        (m.MSG_RT_UPLOAD_MOVE_DMX, struct.pack("<HI", 7, 0) + bytes(FRAMES)),
        (m.MSG_RT_UPLOAD_MOVE_END, b""),
    ]


def run(start, end, flags=0, bloop=0):
    more = struct.pack("<BiHHH", 1, bloop, 3 if bloop else 0, 200 if bloop else 0, flags)
    return m.MSG_RT_RUN_MOVE, struct.pack(
        "<IiiII", 24_000, start, end, 100, 100
    ) + more + struct.pack("<hh", 0, 360)


LAST = FIRST + FRAMES - 1
GO = (m.MSG_RT_GO, b"")
ABC = struct.pack("<iBIH", FIRST + 12, 1, 100, 500)
# How to reach each state: requests, with the milliseconds before the next
STATES = {
    "at rest": [],
    "moving": [((m.MSG_MOTOR_MOVE, b"\x01" + words(900)), 60)],
    "jogging": [((m.MSG_MOTOR_JOG, b"\x02" + struct.pack("<Hi", 4000, 2**31 - 1)), 60)],
    "far away": [((m.MSG_MOTOR_RESET_POSITION, b"\x01" + words(2**31 - 500)), 5)],
    "going to a frame": [((m.MSG_RT_POSITION_FRAME, words(LAST)), 40)],
    "ready": [(run(FIRST, LAST), 700)],
    "in a run": [(run(FIRST, FIRST + 25), 700), (GO, 600)],
    "in a run backward, with a bloop": [(run(LAST, FIRST, 0x20, -1), 1200), (GO, 700)],
    "in a loop": [(run(FIRST, FIRST + 3, 2), 600), (GO, 900)],
    "turning": [(run(FIRST, FIRST + 3, 1), 600), (GO, 350)],
    "in an exposure": [((m.MSG_RT_SHOOT_FRAME, ABC), 600), (GO, 1050)],
    "all jogging": [
        ((m.MSG_RT_POSITION_FRAME, words(FIRST)), 700),
        ((m.MSG_RT_JOG_ALL, words(9000, LAST)), 300),
    ],
    "uploading": [((m.MSG_RT_UPLOAD_MOVE_BEGIN, words(-1_000_000, -999_900)), 2)],
    "lights on their way": [((m.MSG_DMX, b"\x01\x01\x00" + bytes(range(64))), 30)],
}
SETTLED = [((m.MSG_MOTOR_STOP_ALL, b""), 2), ((m.MSG_MOTOR_STOP_ALL, b""), 500)]


def extreme(dice, payload):
    """Return the payload with one to three words, anywhere in it, at an end of some range."""
    changed = bytearray(payload)
    for _ in range(dice.randint(1, 3)):
        if len(changed) >= 4:
            struct.pack_into("<i", changed, dice.randrange(len(changed) - 3), dice.choice(EXTREME))
        elif changed:
            changed[dice.randrange(len(changed))] = dice.choice((0, 1, 2, 3, 127, 128, 255))
    return bytes(changed)


def extremes(state, seed, times):
    """Return a session that reaches the state `times` times and gets extreme requests there."""
    dice = random.Random(f"{state} {seed}")
    script = Script("pico", {"virtuals": 8, "jog_timeout_ms": 200})
    script.motors = MOTORS
    script.says = [f"{state}, seed {seed}"]
    sound = [(kind, payload) for each in STATES.values() for (kind, payload), _ in each] + upload()
    sound += [
        (m.MSG_MOTOR_SET_LIMITS, b"\x01\x01" + words(-500) + b"\x01" + words(5000) + b"\x00"),
        (m.MSG_MOTOR_SET_SPEED, b"\x01" + words(20_000, 100_000)),
        (m.MSG_MOTOR_RESET_POSITION, b"\x01" + words(100)),
        (
            m.MSG_RT_SHOOT_FRAME2,
            struct.pack("<iIhh", FIRST + 12, 250, -30, 400) + b"\x01" + words(0, 400),
        ),
        (m.MSG_GIO_OUT, words(3)),
        (m.MSG_GIO_CAM, words(3)),
        (m.MSG_RT_STOP_LOOP, b""),
        (m.MSG_MOTOR_STATUS, b""),
        (m.MSG_HI, b""),
    ]
    ms = 5
    script.events.append((0, "open", None))

    def send(request, wait):
        nonlocal ms
        number = dice.choice((1, 77, 2**30, 2**31, 2**32 - 1))
        script.events.append((ms, "rx", encode(*request, number)))
        ms += wait

    for motor in range(1, MOTORS + 1):
        send((m.MSG_MOTOR_SET_SPEED, bytes((motor,)) + words(20_000, 200_000)), 2)
    for _ in range(times):
        for request in upload():
            send(request, 3)
        for request, wait in STATES[state]:
            send(request, wait)
        for _ in range(5):
            kind, payload = dice.choice(sound)
            send((kind, extreme(dice, payload)), dice.choice((1, 7, 40)))
        for request, wait in SETTLED:
            send(request, wait)
    script.end = ms
    return script


@pytest.mark.parametrize("state", STATES)
def test_extreme_values(state, runtime, tmp_path):
    times = len(runtime.share(range(3)))
    recording, player = played(extremes(state, 1, times))
    found = differences(runtime, recording, tmp_path / "extremes")
    assert not found
    assert len(player.sent) > 7 * times
