"""why(), watch(), rig(): why nothing moves, where the motors are, what is set."""

import sys

from framestep import boot, texts
from framestep.base.native import const
from framestep.base.results import BY, FRAME, MOTOR, ROOM, WHAT
from framestep.protocol import messages as m
from framestep.repl.commands import REFUSALS, between, dead

_LOOK_MS = const(200)
# Number and name of each message, and the fields of a request up to one that repeats, as in struct.
# One text, as a dictionary would take twice the flash.
MESSAGES = (
    "0001HI ,0020DMX BH,0021GIO_OUT I,0022GIO_IN ,0023GIO_CAM I,0030MOTOR_STATUS ,"
    "0031MOTOR_MOVE Bi,0032MOTOR_STOP B,0033MOTOR_STOP_ALL I,0034MOTOR_GET_POSITION ,"
    "0035MOTOR_RESET_POSITION Bi,0036MOTOR_JOG BHi,0037MOTOR_CONFIGURE BB,"
    "0038MOTOR_SET_SPEED BII,0039MOTOR_SET_LIMITS BBiBiB,003AMOTOR_HARD_STOP ,"
    "0100RT_UPLOAD_MOVE_BEGIN ii,0101RT_UPLOAD_MOVE_AXIS BI,"
    "0102RT_UPLOAD_MOVE_DMX HI,0103RT_UPLOAD_MOVE_END ,0104RT_UPLOAD_MOVE_TRIGGERS I,"
    "0110RT_POSITION_FRAME i,0111RT_RUN_MOVE IiiIIBIHHHHH,0112RT_SHOOT_FRAME iBIH,0113RT_GO ,"
    "0114RT_END ,0115RT_SHOOT_FRAME2 iIhh,0116RT_STOP_LOOP ,0120RT_JOG_ALL Ii,0200VIRT_CONFIG B,"
    "0201VIRT_MOVE Bi,0202VIRT_STOP B,0203VIRT_JOG BHi,0205VIRT_GET_POSITION ,"
    "0206VIRT_JOG_ON_LINE Bh,0207VIRT_AIM_POINT Biii,4600CONDITION ,4601EXCEEDED B,4602HOME ,"
    "4603LOAD ,"
)
_OF_HOSTS = {  # besides the reasons that a command of the REPL can have
    m.ERR_CHECKSUM: "it arrived damaged",
    m.ERR_UNSUPPORTED: "framestep does not know it",
    m.ERR_NOT_IN_POSITION: "the motors are not where it begins",
    m.ERR_PREROLL: "in the pre-roll a motor would pass a limit, or needs more time",
    m.ERR_POSTROLL: "in the post-roll a motor would pass a limit, or needs more time",
    m.ERR_AIM_COD: "the aim point is too near",
}


def message(kind):
    """Return a message's name, and the fields of a request as in struct."""
    at = MESSAGES.find("%04X" % kind)
    if at < 0:
        return "message 0x%04X" % kind, ""
    return MESSAGES[at + 4 : MESSAGES.find(",", at)].split(" ")


def reason(code):
    """Return why a request was refused with this code, as text."""
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
        name = message(refused >> 8)[0]
        lines.append("refused: %s, as %s" % (name, reason(refused & 0xFF)))
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
