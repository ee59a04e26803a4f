"""Short commands for the bench, on the REPL beside the protocol's port. They take memory from the first import on.

    import framestep.repl

    status()       what the controller does, where the motors are, how much can be uploaded
    move(1, 200)   motor 1 to step 200
    jog()          motors by keys; jog(2, 3000): motor 2 first, at 3000 of 10000
    stop()         all motors come to rest
    io()           outputs, inputs, switches; io(1, True): output 1 on
    timing()       what a tick costs, the worst lateness, the depth of the queues
    rig()          the settings of the rig file

Whatever moves a motor is refused, in words, while an operation of Dragonframe waits or runs. Everything is done between
two passes of the main loop, so nothing is half done when a pass looks at it.
"""

import sys
from array import array

from framestep import boot, words
from framestep.controller import VERSION
from framestep.motion.stepper import CLOCK, HEAD, LATEST, SEGMENTS, TAIL, TICKS, WORST_LATE
from framestep.moves.stage import ENDING, READY
from framestep.moves.store import READY as UPLOADED
from framestep.native import CPYTHON, const, micropython, ptr32
from framestep.protocol import messages as m

_FAR = const(2147483647)  # beyond any position
_WRAP = const(0x3FFFFFFF)
_QUIET_US = const(3)  # gaps up to this long are the measuring loop itself
_WINDOW_US = const(4000)  # at a time: passes wait meanwhile
_WINDOWS = const(50)

REFUSALS = {
    m.ERR_MOVING: "an operation of Dragonframe has the motor",
    m.ERR_GENERAL: "the rig may not move it: E-stop held, rig file wrong, driver failed, motor disabled or led",
    m.ERR_RANGE: "there is no such motor or value",
    m.ERR_SOFT_UP: "that is past the upper soft limit",
    m.ERR_SOFT_LOW: "that is past the lower soft limit",
    m.ERR_HARD_UP: "the upper limit switch is hit",
    m.ERR_HARD_LOW: "the lower limit switch is hit",
}


def _between(function, *arguments):
    """What the function returns, called between two passes."""
    hal = boot.hal
    if CPYTHON or not hal.alive:
        return function(*arguments)
    found = []

    def call():
        try:
            found.append(function(*arguments))
        except Exception as error:
            found.append(None)
            found.append(error)

    hal.task = call
    while not found and hal.alive:
        hal.idle()
    if len(found) > 1:
        raise found[1]
    return found[0]


# ---- what is going on ------------------------------------------------------------------------------------


def _operation(controller):
    """What Dragonframe's operation is doing, in words; None if there is none."""
    if controller.virtuals.engaged:
        return "a virtual move is on"
    stage = controller.stage
    if not stage.busy:
        return None
    moves = controller.moves
    name = "a run" if stage.operation is moves.run else "an exposure" if stage.operation is moves.shoot else "a jog-all"
    if stage.running and stage.state != ENDING:
        return "%s is on, at frame %.2f" % (name, stage.move_time / 1000)
    if stage.state == ENDING:
        return "%s comes to rest" % name
    return "%s waits for GO" % name if stage.state == READY else "the motors go to where %s begins" % name


def _dead():
    """Why nothing can be done, in words; None as long as the controller runs."""
    if boot.controller is None:
        return "framestep has not been started"
    if boot.hal.alive:
        return None
    return "framestep has stopped by a fault in the firmware" if boot.hal.failure else "framestep has been stopped"


def _refusal(code):
    """Says why it is not done; True if it is."""
    if code == m.OK:
        return True
    print("refused:", REFUSALS.get(code, "0x%04X" % code) if isinstance(code, int) else code)
    return False


def _report():
    controller = boot.controller
    lines = ["framestep %d.%d.%d, %s" % (VERSION + (controller.rig.name.decode(),))]
    lines.append("the host is connected" if controller.was_open else "no host is connected")
    lines.append(_dead() or _operation(controller) or ("motors move" if controller.axes.moving else "nothing moves"))
    lines += words.conditions(controller.condition()) + words.faults(controller.fault) + words.positions(controller)
    if controller.drivers:
        lines += controller.drivers.states_in_words()
    store = controller.moves.store
    room = controller.moves.cues.room
    kept = store.end - store.start + 1 if store.state == UPLOADED else 0
    lines.append("uploaded: %d frames, room for %d" % (kept, controller.moves.upload_frames))
    lines.append("room for %d changes of light and %d frames with triggers" % room)
    return lines


def status():
    """What the controller does, where its motors are and how far that can be trusted, what an upload may have."""
    if boot.controller is None:
        print(_dead())
        return
    for line in _between(_report):
        print(line)


# ---- motors ----------------------------------------------------------------------------------------------


def _send(motor, target, speed):
    """A code, or words. speed: 1 … 10000, or None for a move."""
    controller = boot.controller
    held = _dead() or _operation(controller)
    if held:
        return held
    if not 1 <= motor <= controller.count or not -_FAR - 1 <= target <= _FAR:
        return m.ERR_RANGE
    controller.words[0] = target
    if speed is None:
        return controller.move(motor - 1)
    return controller.jog(motor - 1, speed) if 1 <= speed <= 10000 else m.ERR_RANGE


def move(motor, step):
    """Move a motor (1 …) to a step, with its speed and inside its limits. Whether it was taken."""
    return _refusal(_between(_send, motor, step, None))


def stop():
    """All motors come to rest, by ramps; once more within a second: harder. A run of Dragonframe's ends as well."""
    dead = _dead()
    if dead:
        print(dead)
    else:
        _between(boot.controller.stop_all)


def jog(motor=1, speed=1000):
    """Jog by keys: + and - move as long as they are held, 1 … 9 choose the motor, any other key ends.

    speed: 1 … 10000, of the motor's own. A motor stops when no key has come for the rig's jog_timeout_ms.
    """
    print("+ and - jog motor %d, 1 to 9 choose another, any other key ends" % motor)
    while True:
        key = sys.stdin.read(1)
        if key in ("+", "-"):
            if not _refusal(_between(_send, motor, _FAR if key == "+" else -_FAR, speed)):
                return
        elif "1" <= key <= "9":
            motor = int(key)
            print("motor", motor)
        else:
            break
    stop()


# ---- inputs and outputs ----------------------------------------------------------------------------------


def _pins(entries, on):
    """Lines about outputs or inputs; on(i) tells whether number i, from 0, is on."""
    return ["%d, pin %d: %s" % (i + 1, entry["pin"], "on" if on(i) else "off") for i, entry in enumerate(entries)]


def _levels():
    controller = boot.controller
    hal = boot.hal
    settings = controller.rig
    levels = hal.levels()
    inputs = controller.io.gio.inputs.values

    def high(entry):
        return (levels >> entry["pin"] & 1) == (entry["on"] == "high")

    lines = ["output " + line for line in _pins(settings.outputs, lambda i: high(settings.outputs[i]))]
    lines += ["input " + line for line in _pins(settings.inputs, lambda i: inputs >> i & 1)]
    for key in ("shutter", "meter"):
        if key in hal.board:
            lit = high({"pin": hal.board[key], "on": getattr(settings, key + "_on")})
            lines.append("%s, pin %d: %s" % (key, hal.board[key], "on" if lit else "off"))
    if settings.estop != "none":
        lines.append("E-stop, pin %d: %s" % (hal.board["estop"], "held" if controller.safety.tripped else "free"))
    for i, entry in enumerate(settings.limits):
        for end in ("high", "low"):
            if entry[end] >= 0:
                level = "high" if levels >> entry[end] & 1 else "low"
                lines.append("limit set %d, %s end, pin %d: level %s" % (i + 1, end, entry[end], level))
    lit = sum(1 for level in controller.io.lights.levels if level)
    lines.append("lights: %d of %d channels are on" % (lit, controller.io.lights.count))
    return lines


def io(output=None, on=None):
    """How outputs, inputs and switches are; io(1, True) switches output 1 on."""
    dead = _dead()
    if dead:
        print(dead)
    elif output is None:
        for line in _between(_levels):
            print(line)
    elif 1 <= output <= boot.controller.io.gio.outputs.count:
        bit = 1 << (output - 1)
        _between(boot.controller.io.gio.put, bit, bit if on else 0)
    else:
        _refusal(m.ERR_RANGE)


# ---- figures ---------------------------------------------------------------------------------------------


@micropython.viper
def _gaps(clock: ptr32, us: int, out: ptr32):
    """Watch a microsecond counter for `us`: out[0] += the length of all gaps in it, out[1] = the longest one."""
    begun = clock[0]
    last = begun
    while last - begun < us:
        now = clock[0]
        gap = now - last
        if gap > _QUIET_US:
            out[0] = out[0] + gap
            if gap > out[1]:
                out[1] = gap
        last = now


def timing():
    """What a tick costs, how late it has been, and how many segments wait for each motor that moves."""
    dead = _dead()
    if dead:
        print(dead)
        return
    kernel = boot.hal.kernel
    state = kernel.state
    if not CPYTHON:
        out = array("i", [0, 0])
        ticks = 0
        for _ in range(_WINDOWS):
            before = state[TICKS]
            _gaps(state[CLOCK], _WINDOW_US, out)
            ticks += (state[TICKS] - before) & _WRAP
        print(
            "interrupts: %d us in a tick of 1000 on average, %d us at a time at most"
            % (out[0] // max(ticks, 1), out[1])
        )
    print("worst lateness of a tick in motion: %d us, bearable are %d" % (state[WORST_LATE], state[LATEST]))
    for motor in range(boot.controller.count):
        if boot.controller.axes[motor].moving:
            block = kernel.blocks[motor]
            print("motor %d: %d of %d segments wait" % (motor + 1, (block[TAIL] - block[HEAD]) & _WRAP, SEGMENTS))


def rig():
    """The settings of the rig file, with those that it does not mention."""
    if boot.controller is None:
        print(_dead())
        return
    settings = boot.controller.rig
    for name in sorted(settings.settings):
        if name in ("motors", "outputs", "inputs", "limits"):
            for i, entry in enumerate(getattr(settings, name), 1):
                print(name, i, entry)
        else:
            print(name, "=", settings.settings[name])


if not CPYTHON:
    import __main__

    for _command in (status, move, jog, stop, io, timing, rig):
        setattr(__main__, _command.__name__, _command)
    print("status() move(1, 200) jog() stop() io() timing() rig()")
