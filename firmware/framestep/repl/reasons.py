"""why(), watch(), rig(): why nothing moves, where the motors are, what is set."""

import sys

from framestep import boot, texts
from framestep.base.native import const
from framestep.base.results import BY, FRAME, MOTOR, ROOM, WHAT
from framestep.protocol import messages as m
from framestep.repl.commands import REFUSALS, between, dead

_LOOK_MS = const(200)
_NAMES = {
    m.MSG_MOTOR_MOVE: "MOTOR_MOVE",
    m.MSG_MOTOR_JOG: "MOTOR_JOG",
    m.MSG_MOTOR_SET_SPEED: "MOTOR_SET_SPEED",
    m.MSG_MOTOR_SET_LIMITS: "MOTOR_SET_LIMITS",
    m.MSG_RT_UPLOAD_MOVE_END: "the upload of a move",
    m.MSG_RT_POSITION_FRAME: "RT_POSITION_FRAME",
    m.MSG_RT_RUN_MOVE: "RT_RUN_MOVE",
    m.MSG_RT_GO: "RT_GO",
    m.MSG_RT_JOG_ALL: "RT_JOG_ALL",
    m.MSG_RT_SHOOT_FRAME2: "RT_SHOOT_FRAME2",
    m.MSG_VIRT_MOVE: "VIRT_MOVE",
    m.MSG_VIRT_JOG: "VIRT_JOG",
}
_OF_HOSTS = {  # besides the reasons that a command of the REPL can have
    m.ERR_CHECKSUM: "it arrived damaged",
    m.ERR_UNSUPPORTED: "framestep does not know it",
    m.ERR_NOT_IN_POSITION: "the motors are not where it begins",
    m.ERR_PREROLL: "in the pre-roll a motor would pass a limit, or needs more time",
    m.ERR_POSTROLL: "in the post-roll a motor would pass a limit, or needs more time",
    m.ERR_AIM_COD: "the aim point is too near",
}


def _reason(code):
    return REFUSALS.get(code) or _OF_HOSTS.get(code, "0x%04X" % code)


def _exceeded(controller):
    found = controller.operations.exceeded
    return texts.exceeded(found[WHAT], found[MOTOR] + 1, found[FRAME], found[BY], found[ROOM])


def _reasons():
    controller = boot.controller
    lines = [dead()] if dead() else []
    if boot.mistake:
        lines.append(boot.mistake)
    conditions = controller.condition() & ~m.CONDITION_EXCEEDED  # its own line follows
    lines += texts.conditions(conditions) + texts.faults(controller.faults)
    refused = controller.refused
    if isinstance(refused, str):
        lines.append("refused: a command of the REPL, as " + refused)
    elif refused:
        kind = refused >> 8
        name = _NAMES.get(kind, "message 0x%04X" % kind)
        lines.append("refused: %s, as %s" % (name, _reason(refused & 0xFF)))
    return lines + _exceeded(controller)


def why():
    """Print why the motors were stopped, and why the last refused request was."""
    if boot.controller is None:
        print(dead())
        return
    for line in between(_reasons) or ("nothing was refused, and nothing has stopped the motors",):
        print(line)


def _reported():
    axes = boot.controller.axes
    axes.choose_sample()
    return ["%d: %d" % (motor + 1, axes.reported[motor]) for motor in range(axes.positions.count)]


def _key(ms):
    """Wait for a key. Return whether one has been pressed; it is read."""
    import select

    poll = select.poll()
    poll.register(sys.stdin, select.POLLIN)
    return bool(poll.poll(ms) and sys.stdin.read(1))


def watch():
    """Print the motors' positions again and again, in one line, until a key is pressed."""
    why = dead()
    if why:
        print(why)
        return
    print("any key ends")
    while True:
        print("\r" + "   ".join(between(_reported)), end="    ")
        if dead() or _key(_LOOK_MS):
            break
    print()


def rig():
    """Print the settings that differ from their defaults."""
    if boot.controller is None:
        print(dead())
        return
    from framestep.rig import settings as known

    rig = boot.controller.rig
    _changed("", rig.settings, known.SETTINGS)
    for name, table in (
        ("motors", known.MOTOR_SETTINGS),
        ("limits", known.LIMIT_SETTINGS),
        ("outputs", known.OUTPUT_SETTINGS),
        ("inputs", known.INPUT_SETTINGS),
    ):
        for i, entry in enumerate(getattr(rig, name), 1):
            _changed("%s[%d]." % (name, i), entry, table)
    print("all else is at its default")


def _changed(where, found, table):
    for key in sorted(found):
        # lists of the whole file follow with all keys of their entries
        if table[key][0] is not list and found[key] != table[key][3]:
            print(where + key, "=", found[key])
