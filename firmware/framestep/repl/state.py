"""status(), io(): the state of controller and pins."""

from framestep import boot, texts
from framestep.base.results import BY, FRAME, MOTOR, ROOM, WHAT
from framestep.moves.upload.chunks import SIZE, UNIT, room
from framestep.moves.upload.store import READY as UPLOADED
from framestep.protocol import messages as m
from framestep.repl.commands import between, dead, operation, refusal
from framestep.reports import VERSION


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
    exceeded = controller.operations.exceeded
    lines += texts.exceeded(
        exceeded[WHAT], exceeded[MOTOR] + 1, exceeded[FRAME], exceeded[BY], exceeded[ROOM]
    )
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
