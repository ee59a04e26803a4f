"""From power-on to a running controller.

The uploaded move gets, in one piece, the memory that remains once everything else is loaded. So the
heap is collected often while modules load, as loading leaves holes. The code that reads the rig
file is dropped after use, and the move's memory is allocated last.

Memory for the REPL and for a user's own code is set aside first of all, at the low end of the heap.
MicroPython searches for free memory from there, and does so often, as larger call frames come from
the heap. Beyond the move's memory, a search took 0.1 ms.
"""

import gc
import sys

from framestep.base.native import const
from framestep.protocol.messages import CONDITION_OVERLAY, CONDITION_OVERLAY_LEFT_OUT

_DENSE = const(3072)  # bytes taken between two collections
_SAVE = "framestep: set a smaller motor_count or virtuals in rig.json"

hal = None
controller = None
runner = None
mistake = None  # text of the mistake in the rig file
# Modules that are needed only to read the rig file
READING = (
    "framestep.rig.homes",
    "framestep.rig.servos",
    "framestep.rig.pendants",
    "framestep.rig.settings",
    "framestep.rig.drivers",
    "framestep.rig.pins",
    "framestep.rig",
    "framestep.board",
    "framestep.io.tmc2209_setup",
)


class Settings:
    """Result of framestep.rig, without its code, which is needed only once and takes 9 kB."""

    def __init__(self, rig, motors):
        self.motors = []
        for i in range(motors):
            found = rig.motor(i)
            for same in self.motors:  # motors with equal settings share them
                if same == found:
                    found = same
            self.motors.append(found)
        for name in ("motors", "outputs", "inputs", "limits"):
            rig.settings[name] = None  # as in the file; the rig has them with all keys
        for name, value in rig.__dict__.items():
            if name != "motors":
                setattr(self, name, value)

    def motor(self, i):
        return self.motors[i]


def forget(*names):
    """Unload modules to free their memory. List a package after its modules."""
    for name in names:
        if sys.modules.pop(name, None):
            package, last = name.rsplit(".", 1)
            delattr(sys.modules[package], last)


def _settings(board):
    global mistake
    from framestep import rig

    found, mistake = rig.load(board=board)
    settings = Settings(found, len(found.board["step"]))
    forget(*READING)
    return settings


def judge(text):
    """Check the text of a rig file: (True, summary for this board), (False, what is wrong), or
    (None, "") if there is no memory for an answer. For the REPL. Unloads its code afterwards."""
    try:
        import json

        from framestep.board import BOARD
        from framestep.rig import Rig, RigError

        try:
            rig = Rig(json.loads(text), BOARD)
        except RigError as error:
            return False, str(error)
        except ValueError:
            return False, "not valid JSON"
        name = BOARD["name"]
        return True, "valid for %s: '%s', %d motors set" % (
            name,
            rig.name.decode(),
            len(rig.motors),
        )
    except MemoryError:
        return None, ""
    finally:
        forget(*READING)
        gc.collect()


def start(again=False):
    """Bring the board up. again: called by boot.py after a soft reset. With one port it then waits
    for main.py or a reset, as boot.py would never end.

    A mistake in the rig file is printed on the REPL; the board then answers, but moves nothing.
    """
    global hal, controller, runner
    if controller:  # by boot.py, after a soft reset
        return
    try:
        from framestep.board import BOARD
    except ValueError as error:  # no pin is known, so none is touched
        print("framestep: not started,", error)
        return

    chip = __import__("framestep.hal.%s.start" % BOARD.pop("hal"), None, None, ("held",))
    chip.clear()  # in case boot.py is not framestep's
    spare = bytearray(chip.SPARE)
    held = chip.held(BOARD)
    if held:
        print("framestep: not started,", held)
        return
    gc.threshold(_DENSE)
    settings = _settings(BOARD)
    del BOARD
    # first, because they would float while the rest is loaded
    chip.drivers_off(settings.board, settings)
    if again and settings.ports != 2:
        gc.threshold(-1)
        return
    chip.prepare(settings.board)
    if mistake:
        print("framestep:", mistake)
        print("framestep: nothing moves until the file is corrected and the board reset")
    try:
        from framestep.controller import Controller
        from framestep.runner import Runner

        hal = chip.make(settings.board, settings)
        forget(*chip.SPENT)  # the controller fills their places
        gc.collect()
        if hal.watchdog.caused_reset and settings.ports == 2:
            print(
                "framestep: the watchdog restarted the board: the firmware hung while motors moved"
            )
        runner = Runner(hal, settings.ports == 2)
        controller = Controller(hal, settings, broken=mistake is not None)
        overlay = sys.modules.get("framestep_overlay")
        if overlay:
            controller.overlay = CONDITION_OVERLAY if overlay.in_use else CONDITION_OVERLAY_LEFT_OUT
    except MemoryError:
        print(_SAVE)
        raise
    # again, because the button can only be pressed after the chip's own loader has checked it
    held = chip.held(settings.board)
    if held:
        gc.threshold(-1)
        print("framestep: not started,", held)
        return
    gc.collect()  # so that what start() makes fills holes, not the room for moves
    hal.start()
    release = chip.release
    forget("framestep.io.position_restore", *chip.SPENT)
    del chip
    try:
        controller.moves.take_memory()
    except ValueError as error:
        # With one port, it is the protocol's by now; HI reports room for no frame.
        if settings.ports == 2:
            print("framestep: too little memory is left for moves:", error)
            print(_SAVE)
    release(spare)
    gc.collect()
    gc.threshold(-1)
    if overlay:
        overlay.started()
    runner.run(controller)
