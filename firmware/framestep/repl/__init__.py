"""Short commands for the REPL, which work while the protocol's port is in use.

    import framestep.repl
    help()

While an operation of Dragonframe waits or runs, commands that would move a motor are refused with
an explanation. The code of a command (framestep/repl) is loaded for the call and dropped after it.
"""

import gc

from framestep.base.native import CPYTHON
from framestep.boot import READING, forget

_NO_MEMORY = (
    "() needs more memory than is free: delete what your program holds, or set a smaller "
    "motor_count or virtuals in rig.json"
)
_COMMANDS = (
    "status() why() watch() trace() move(1, 200) home(1) jog() stop() io() timing() rig() help()"
)


# loaded for a command, and unloaded after it
_MODULES = (
    "framestep.repl.guide",
    "framestep.repl.tracing",
    "framestep.repl.reasons",
    "framestep.repl.state",
    "framestep.repl.motion",
    "framestep.repl.figures",
    "framestep.repl.commands",
    "framestep.texts",
)


def _call(module, name, *arguments):
    try:
        found = __import__("framestep.repl." + module, None, None, (name,))
        return getattr(found, name)(*arguments)
    except MemoryError:
        print(name, _NO_MEMORY, sep="")
    finally:
        if not CPYTHON:
            gc.collect()  # first, since even to forget takes memory: 16 bytes for each module
            for loaded in _MODULES:
                forget(loaded)
            gc.collect()


def status():
    """Print what the controller does, where its motors are, and how many frames fit."""
    _call("state", "status")


def why():
    """Print why the motors were stopped, and why the last refused request was."""
    _call("reasons", "why")


def watch():
    """Print the motors' positions until a key is pressed."""
    _call("reasons", "watch")


def trace(count=20):
    """Print the last requests and answers, with their times since power-up in seconds.

    Tracing begins with the first call; trace(0) ends it. Questions for status and positions are
    left out.
    """
    _call("tracing", "trace", count)


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
    """Print the settings that differ from their defaults."""
    _call("reasons", "rig")
    if not CPYTHON:
        for name in READING:  # the code that knows the defaults
            forget(name)


def help(*things):
    """Print the commands with a line each. help(thing) is MicroPython's own help."""
    if things:
        import builtins

        builtins.help(*things)
    else:
        _call("guide", "show")


if not CPYTHON:
    import __main__

    for _command in (status, why, watch, trace, move, home, jog, stop, io, timing, rig, help):
        setattr(__main__, _command.__name__, _command)
    print(_COMMANDS)
