"""Runs on MicroPython and on CPython: the kinematics of the virtual axes, each line of a script
with the heap locked.

Lines on standard input, each answered by one line of numbers, a code first:

    CONFIG kind configuration table-in-hex eight-steps
                                the pose at these steps; configuration: 24 words
    LOCATE eight-steps          the same
    POSE twelve-words           inverse(): the joints, and the places of the motors
    AIM six-words twelve-words  aim point and pose: pan and tilt, and the camera's three axes
"""

import sys
from array import array

from framestep.virtual_axes.kinematics import aim, boom_swing_track, swing_pan, x_y_z, y_swing_track
from framestep.virtual_axes.kinematics.kinematics import Configuration, camera_axis
from framestep.virtual_axes.registers import AIM_X, DIRECTION_PAN, JOINT, NEAR_PAN, REGISTERS, V_PAN

try:
    from micropython import heap_lock, heap_unlock
except ImportError:

    def heap_lock():
        pass

    heap_unlock = heap_lock

r = array("i", [0] * (REGISTERS + 18))
OWN = REGISTERS
rigs = [None, boom_swing_track, swing_pan, y_swing_track, x_y_z]
rigs = [module and module.Geometry(r) for module in rigs]
present = array("i", [0] * 8)
places = array("i", [0] * 12)
configuration = Configuration()


def configured(rig):
    heap_lock()
    code = rig.configure(configuration, present)
    heap_unlock()
    return code


def located(rig):
    heap_lock()
    code = rig.locate(present)
    heap_unlock()
    return code


def reached(rig):
    heap_lock()
    code = rig.inverse()
    if code == 0:
        code = rig.motor_steps(places, 0)
    heap_unlock()
    return code


def aimed():
    heap_lock()
    r[NEAR_PAN], r[NEAR_PAN + 1] = r[V_PAN], r[V_PAN + 1]
    code = aim.direction(r)
    for k in range(4):
        r[V_PAN + k] = r[DIRECTION_PAN + k]
    for axis in range(3):
        camera_axis(r, axis, OWN + 6 * axis)
    heap_unlock()
    return code


def play(lines):
    rig = None
    for line in lines:
        words = line.split()
        what = words[0]
        code = 0
        out = []
        if what == "CONFIG":
            c = configuration
            for k, numbers in enumerate((c.motors, c.steps_per_unit, c.positions, c.lengths)):
                for i in range(6):
                    numbers[i] = int(words[2 + 6 * k + i])
            c.table = bytes.fromhex(words[26][1:])
            c.table_at = 0 if c.table else -1
            for i in range(8):
                present[i] = int(words[27 + i])
            code = configured(rigs[int(words[1])])
            if code == 0:
                rig = rigs[int(words[1])]
            out = list(r[:12])
        elif what == "LOCATE":
            for i in range(8):
                present[i] = int(words[1 + i])
            code = located(rig)
            out = list(r[:12])
        elif what == "POSE":
            for i in range(12):
                r[i] = int(words[1 + i])
            code = reached(rig)
            if code == 0:
                out = list(r[JOINT : JOINT + 12]) + list(places)
        elif what == "AIM":
            for i in range(6):
                r[AIM_X + i] = int(words[1 + i])
            for i in range(12):
                r[i] = int(words[7 + i])
            code = aimed()
            out = list(r[6:10]) + list(r[OWN : OWN + 18])
        print(code, *out)


if __name__ == "__main__":
    play(sys.stdin)
