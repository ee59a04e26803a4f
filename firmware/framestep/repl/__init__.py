"""Short commands for the REPL, which work while the protocol's port is in use.

    import framestep.repl

    status()       what the controller does, where the motors are, how much can be uploaded
    move(1, 200)   move motor 1 to step 200
    home(1)        home motor 1; home(): all motors that have a home switch
    jog()          jog motors by keys; jog(2, 3000): motor 2 first, at 3000 of 10000
    stop()         bring all motors to rest
    io()           outputs, inputs, switches; io(1, True): output 1 on
    timing()       cost of a tick, worst lateness, depth of the queues
    rig()          the settings of the rig file

While an operation of Dragonframe waits or runs, commands that would move a motor are refused with
an explanation. The code of a command (framestep/repl) is loaded for the call and dropped after it.
"""

import gc

from framestep.base.native import CPYTHON
from framestep.boot import forget

_NO_MEMORY = (
    "() needs more memory than is free: delete what your program holds, or set a smaller "
    "motor_count or virtuals in rig.json"
)
_COMMANDS = "status() move(1, 200) home(1) jog() stop() io() timing() rig()"


def _call(module, name, *arguments):
    try:
        found = __import__("framestep.repl." + module, None, None, (name,))
        return getattr(found, name)(*arguments)
    except MemoryError:
        print(name, _NO_MEMORY, sep="")
    finally:
        if not CPYTHON:
            forget(
                "framestep.repl.state",
                "framestep.repl.motion",
                "framestep.repl.figures",
                "framestep.repl.commands",
                "framestep.texts",
            )
            gc.collect()


def status():
    """Print what the controller does, where its motors are, and how many frames fit."""
    _call("state", "status")


def move(motor, step):
    """Move a motor (1 …) to a step at its speed, within its limits. Prints why it is refused."""
    _call("motion", "move", motor, step)


def home(*motors):
    """Home motors (1 …), one after the other; without a number all that have `home` in the rig
    file. Prints why it is refused, or the results in the end."""
    _call("motion", "home", motors)


def jog(motor=1, speed=1000):
    """Jog by keys: + and - move while they are held, 1 … 9 choose the motor, any other key ends.

    speed: 1 … 10000, of the motor's own. A motor stops if no key comes for the rig's
    jog_timeout_ms.
    """
    _call("motion", "jog", motor, speed)


def stop():
    """Ramp all motors down; within a second of another call, by the hard stop. Ends Dragonframe's
    run."""
    _call("motion", "stop")


def io(output=None, on=None):
    """Print the state of outputs, inputs and switches. io(1, True) switches output 1 on."""
    _call("state", "io", output, on)


def timing():
    """Print how long a tick takes, how late it has been, and each moving motor's queue."""
    _call("figures", "timing")


def rig():
    """Print the settings of the rig file, including defaults."""
    _call("state", "rig")


if not CPYTHON:
    import __main__

    for _command in (status, move, home, jog, stop, io, timing, rig):
        setattr(__main__, _command.__name__, _command)
    print(_COMMANDS)
