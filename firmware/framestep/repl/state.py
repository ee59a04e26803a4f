"""status(), why(), watch(), io(), rig(): the state of controller, pins and settings."""

import sys

from framestep import boot, texts
from framestep.base.native import const
from framestep.base.results import BY, FRAME, MOTOR, ROOM, WHAT
from framestep.moves.upload.chunks import SIZE, UNIT, room
from framestep.moves.upload.store import READY as UPLOADED
from framestep.protocol import messages as m
from framestep.repl.commands import between, dead, operation, reason, refusal
from framestep.reports import VERSION

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


def _report():
    controller = boot.controller
    lines = ["framestep %d.%d.%d, %s" % (VERSION + (controller.rig.name.decode(),))]
    lines.append("the host is connected" if controller.was_open else "no host is connected")
    lines.append(
        dead()
        or operation(controller)
        or ("motors move" if controller.axes.moving else "nothing moves")
    )
    lines += (
        texts.conditions(controller.condition())
        + texts.faults(controller.faults)
        + texts.positions(controller)
    )
    lines += _exceeded(controller)
    if controller.drivers:
        lines += controller.drivers.states_in_words()
    store = controller.moves.store
    kept = store.end - store.start + 1 if store.state == UPLOADED else 0
    lines.append("uploaded: %d frames, room for %d" % (kept, controller.moves.upload_frames))
    lines.append(
        "of %d bytes for positions, lights and triggers %d are free"
        % (2 * store.words[SIZE], 2 * UNIT * room(store.words))
    )
    return lines


def status():
    """Print what the controller does, the motors' positions and how far they can be trusted, and
    how much fits into an upload."""
    if boot.controller is None:
        print(dead())
        return
    for line in between(_report):
        print(line)


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
    if refused:
        kind = refused >> 8
        name = _NAMES.get(kind, "message 0x%04X" % kind) if kind else "a command of the REPL"
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


def _pins(entries, on):
    """Return lines about outputs or inputs. on(i): whether number i, from 0, is on."""
    return [
        "%d, pin %d: %s" % (i + 1, entry["pin"], "on" if on(i) else "off")
        for i, entry in enumerate(entries)
    ]


def _levels():
    controller = boot.controller
    hal = boot.hal
    settings = controller.rig
    levels = hal.levels()
    inputs = controller.io.gio.inputs.values

    def high(entry):
        return ((levels >> entry["pin"]) & 1) == (entry["on"] == "high")

    lines = [
        "output " + line for line in _pins(settings.outputs, lambda i: high(settings.outputs[i]))
    ]
    lines += ["input " + line for line in _pins(settings.inputs, lambda i: (inputs >> i) & 1)]
    for key in ("shutter", "meter"):
        if key in hal.board:
            lit = high({"pin": hal.board[key], "on": getattr(settings, key + "_on")})
            lines.append("%s, pin %d: %s" % (key, hal.board[key], "on" if lit else "off"))
    if settings.estop != "none":
        lines.append(
            "E-stop, pin %d: %s"
            % (hal.board["estop"], "held" if controller.safety.tripped else "free")
        )
    for i, entry in enumerate(settings.limits):
        for end in ("high", "low"):
            if entry[end] >= 0:
                level = "high" if (levels >> entry[end]) & 1 else "low"
                lines.append(
                    "limit set %d, %s end, pin %d: level %s" % (i + 1, end, entry[end], level)
                )
    lit = sum(1 for level in controller.io.lights.levels if level)
    lines.append("lights: %d of %d channels are on" % (lit, controller.io.lights.count))
    return lines


def io(output=None, on=None):
    """Print the state of outputs, inputs and switches. io(1, True) switches output 1 on."""
    why = dead()
    if why:
        print(why)
    elif output is None:
        for line in between(_levels):
            print(line)
    elif 1 <= output <= boot.controller.io.gio.outputs.count:
        bit = 1 << (output - 1)
        between(boot.controller.io.gio.put, bit, bit if on else 0)
    else:
        refusal(m.ERR_RANGE)


def rig():
    """Print the settings that differ from their defaults."""
    if boot.controller is None:
        print(dead())
        return
    from framestep.rig.settings import SETTINGS

    found = boot.controller.rig.settings
    changed = [name for name in sorted(found) if found[name] != SETTINGS[name][3]]
    for name in changed:
        value = found[name]
        if isinstance(value, list):
            for i, entry in enumerate(value, 1):
                print("%s[%d]:" % (name, i), entry)
        else:
            print(name, "=", value)
    print("all else is at its default" if changed else "everything is at its default")
