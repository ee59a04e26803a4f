"""Sessions that reveal a fault in the firmware."""

import struct

from framestep.protocol import messages as m
from host_tests.script import Script

from .chip_player import CHIPS
from .link import frame
from .trial import Trial


class Host:
    """A host with a board under trial. make: makes the board from a script."""

    def __init__(self, rig=None, board="pico", make=Trial, target="host"):
        script = Script(
            board if target == "host" else CHIPS[target].board, rig or {"motor_count": 2}
        )
        script.target = target
        self.trial = make(script)
        self.number = 0
        self.trial.do("open")
        self.wait(5)

    def wait(self, ms):
        for _ in range(ms):
            self.trial.step()

    def send(self, kind, form="", *values, ms=2):
        self.number += 1
        self.trial.do("rx", frame(kind, struct.pack("<" + form, *values), self.number))
        self.wait(ms)

    def rest(self, ms=3000):
        """Wait until MOTOR_STATUS is 0, then a little longer."""
        end = self.trial.ms + ms
        while self.trial.ms < end:
            self.send(m.MSG_MOTOR_STATUS)
            if self.trial.last_status == 0:
                break
            self.wait(20)
        self.send(m.MSG_MOTOR_GET_POSITION)
        self.wait(40)
        self.send(m.MSG_MOTOR_STATUS)
        for motor in self.trial.motors:
            self.trial.judge(motor)

    def speed(self, motor=1, velocity=1000, acceleration=4000):
        self.send(m.MSG_MOTOR_SET_SPEED, "BII", motor, velocity, acceleration)

    def move(self, motor=1, to=1500):
        self.send(m.MSG_MOTOR_MOVE, "Bi", motor, to)

    def upload(self, *paths):
        self.send(m.MSG_RT_UPLOAD_MOVE_BEGIN, "ii", 1, len(paths[0]))
        for i, path in enumerate(paths, 1):
            self.send(m.MSG_RT_UPLOAD_MOVE_AXIS, f"BI{len(path)}i", i, 1 << 31, *path)
        self.send(m.MSG_RT_UPLOAD_MOVE_END)

    def play(self, frames, fps=24, pre=300, post=300):
        self.send(m.MSG_RT_RUN_MOVE, "IiiIIBIHH", fps * 1000, 1, frames, pre, post, 0, 0, 0, 0)
        self.rest()
        self.send(m.MSG_RT_GO)
        for _ in range(6000):
            self.trial.step()
            if self.trial.runs.going is None:
                break


PATH = [round(2 * k + 0.8 * k * k - 0.02 * k**3) for k in range(24)]


def moves(host):
    host.speed()
    host.move()
    host.rest()


def two_moves(host):
    moves(host)
    host.move(to=-200)
    host.rest()


def asked_often(host):
    """A request each 4 ms."""
    for _ in range(100):
        host.speed()
        host.wait(2)


def asked_while_coming_to_rest(host):
    """Each millisecond, whenever the tick is due, of a motor that stops at once."""
    host.speed(1, 1900, 2_000_000)
    for moment in range(10):
        host.trial.player.shift(100_000)
        host.move(to=20_000)
        host.wait(50 + moment)
        host.send(m.MSG_MOTOR_STOP, "B", 1)
        for _ in range(20):
            host.send(m.MSG_MOTOR_STATUS, ms=1)


def stopped(host):
    host.speed()
    host.move(to=5000)
    host.wait(600)
    host.send(m.MSG_MOTOR_STOP_ALL)
    host.wait(1500)
    host.rest()


def run(host):
    host.speed(1, 3000, 20000)
    host.upload(PATH, PATH[::-1])
    host.play(24)
    host.rest()


def slow(host):
    host.speed(1, 3000, 20000)
    host.upload([0, 1, 0, 2, 0, 1, 2, 1, 3, 2, 3, 2, 1, 0, 1, 0], [100 * k for k in range(16)])
    host.play(16, 16)
    host.rest()


def coupled(host):
    host.send(m.MSG_MOTOR_CONFIGURE, "BB", 1, m.MOTOR_ENABLED | m.MOTOR_COUPLE)
    moves(host)


def limited(host):
    host.speed()
    host.send(m.MSG_MOTOR_SET_LIMITS, "BBiBiB", 1, 1, -100, 1, 400, 0)
    host.send(m.MSG_MOTOR_JOG, "BHi", 1, 10000, 2**31 - 1)
    host.rest()


def outputs_on(host):
    host.send(m.MSG_GIO_OUT, "I", 3)
    host.send(m.MSG_GIO_CAM, "I", 3)
    host.trial.do("close")
    host.wait(30)


def pressed(host):
    host.send(m.MSG_HI)
    host.trial.do("pin", ("estop", 0))
    host.wait(10)
    host.move()
    host.rest()


SESSIONS = (moves, two_moves, stopped, run, slow, coupled, limited, outputs_on, pressed)


def looked_at(host, seconds=6):
    for _ in range(10 * seconds):
        host.wait(100)
        host.send(m.MSG_MOTOR_STATUS)


def stopped_alone(host):
    host.speed()
    host.move(to=20_000)
    host.wait(300)
    host.send(m.MSG_MOTOR_STOP, "B", 1)
    looked_at(host)


def jogs_beside(host):
    host.upload([0, 5, 10])
    host.send(m.MSG_MOTOR_JOG, "BHi", 2, 10000, 2**31 - 1)
    host.send(m.MSG_RT_POSITION_FRAME, "i", 2)
    looked_at(host)


def prepared_in_motion(host):
    host.upload([0, 5, 10])
    host.move(2)
    run = struct.pack("<IiiIIBIHH", 24000, 1, 3, 300, 300, 0, 0, 0, 0)
    host.trial.do("rx", frame(m.MSG_MOTOR_STATUS, b"", 1001) + frame(m.MSG_RT_RUN_MOVE, run, 1002))
    host.wait(5)
