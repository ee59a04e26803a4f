"""Functions that the commands of framestep.repl share.

Each call loads its command's code, because memory is scarce. A command runs between two passes of
the main loop, so a pass never finds anything half done.
"""

from framestep import boot
from framestep.base.native import CPYTHON
from framestep.moves.operation_runner import ENDING, LEAVING, READY
from framestep.protocol import messages as m

if not CPYTHON:
    from micropython import heap_lock, heap_unlock

REFUSALS = {
    m.ERR_MOVING: "it moves, is being homed, or an operation of Dragonframe has it",
    m.ERR_GENERAL: (
        "it may not move: E-stop held, rig file wrong, driver failed, clock changed, motor "
        "disabled or coupled"
    ),
    m.ERR_RANGE: "there is no such motor or value",
    m.ERR_SOFT_UP: "that is past the upper soft limit",
    m.ERR_SOFT_LOW: "that is past the lower soft limit",
    m.ERR_HARD_UP: "the upper limit switch is hit",
    m.ERR_HARD_LOW: "the lower limit switch is hit",
}


def between(function, *arguments):
    """Call a function between two passes. Return its result."""
    runner = boot.runner
    if CPYTHON or not runner.alive:
        return function(*arguments)
    done = False
    found = failure = None

    def call():
        nonlocal done, found, failure
        try:
            found = function(*arguments)
        except Exception as error:
            failure = error
        finally:
            done = True  # even after a Ctrl-C

    runner.task = call
    while not done and runner.alive:
        boot.hal.idle()
    if failure:
        raise failure
    return found


def locked(function, *arguments):
    """Call a function with the heap locked, as in a pass, so that a full heap does not slow it
    down.

    Takes at most two arguments.
    """
    if CPYTHON:
        return function(*arguments)
    first = arguments[0] if arguments else None
    second = arguments[1] if len(arguments) > 1 else None
    heap_lock()
    try:
        if not arguments:
            return function()
        return function(first, second) if len(arguments) > 1 else function(first)
    finally:
        heap_unlock()


def operation(controller):
    """Return what Dragonframe's operation is doing, as text; None if there is none."""
    if controller.virtuals.owned:
        return "a virtual move is on"
    operations = controller.operations
    if not operations.busy:
        return None
    moves = controller.moves
    name = "a jog-all"
    if operations.operation is moves.run:
        name = "a run"
    elif operations.operation is moves.shoot:
        name = "an exposure"
    if operations.running and operations.state != ENDING:
        return "%s is on, at frame %.2f" % (name, operations.move_time / 1000)
    if operations.state == ENDING or operations.state == LEAVING:
        return "%s comes to rest" % name
    return (
        "%s waits for GO" % name
        if operations.state == READY
        else "the motors move to the start of %s" % name
    )


def dead():
    """Return why nothing can be done, as text; None while the controller runs."""
    if boot.controller is None:
        return "framestep has not been started"
    if boot.runner.alive:
        return None
    return (
        "framestep was stopped by a fault in the firmware"
        if boot.runner.failure
        else "framestep has been stopped"
    )


def refusal(code):
    """Print why a request was refused. Return True if it was not."""
    if code == m.OK:
        return True
    if isinstance(code, int):
        code = REFUSALS.get(code, "0x%04X" % code)
    if boot.controller:
        boot.controller.refused = code  # why() says it again
    print("refused:", code)
    return False
