"""move(), home(), jog(), stop(): motors by hand."""

import sys

from framestep import boot
from framestep.base.native import const
from framestep.protocol import messages as m
from framestep.repl.commands import between, dead, locked, operation, refusal

_FAR = const(2147483647)  # beyond any position


def _send(motor, target, speed):
    """Move or jog a motor. Return a code, or the reason as text. speed: 1 … 10000; None: move."""
    controller = boot.controller
    held = dead() or operation(controller)
    if held:
        return held
    if not 1 <= motor <= controller.axes.count or not -_FAR - 1 <= target <= _FAR:
        return m.ERR_RANGE
    controller.motors.words[0] = target
    if speed is None:
        return locked(controller.motors.move, motor - 1)
    return locked(controller.motors.jog, motor - 1, speed) if 1 <= speed <= 10000 else m.ERR_RANGE


def move(motor, step):
    """Move a motor (1 …) to a step, at its speed and within its limits. Return whether it may."""
    return refusal(between(_send, motor, step, None))


def _home(motors):
    """Begin homing. Return a code, or the reason as text."""
    controller = boot.controller
    held = dead() or operation(controller)
    if held:
        return held
    if not controller.homing:
        return "no motor has `home` in the rig file"
    bits = 0
    for motor in motors:
        if not 1 <= motor <= controller.axes.count:
            return m.ERR_RANGE
        bits |= 1 << (motor - 1)
    return locked(controller.homing.start, bits or controller.homing.usable())


def home(motors):
    """Home these motors (1 …), or all that have `home` in the rig file."""
    refusal(between(_home, motors))


def stop():
    """Ramp all motors down; within a second of another call, by the hard stop. Ends Dragonframe's
    run."""
    why = dead()
    if why:
        print(why)
    else:
        between(locked, boot.controller.stops.stop_all)


def jog(motor=1, speed=1000):
    """Jog by keys: + and - move while they are held, 1 … 9 choose the motor, any other key ends.

    speed: 1 … 10000, of the motor's own. A motor stops if no key comes for the rig's
    jog_timeout_ms.
    """
    print("+ and - jog motor %d, 1 to 9 choose another, any other key ends" % motor)
    while True:
        key = sys.stdin.read(1)
        if key in ("+", "-"):
            if not refusal(between(_send, motor, _FAR if key == "+" else -_FAR, speed)):
                return
        elif "1" <= key <= "9":
            motor = int(key)
            print("motor", motor)
        else:
            break
    stop()
