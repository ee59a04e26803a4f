"""From power-on to a running controller."""

import gc

gc.threshold(4096)  # loading modules leaves holes in the heap that nothing large fits in, unless they are filled again

from framestep import rig  # noqa: E402
from framestep.board import BOARD  # noqa: E402
from framestep.controller import Controller  # noqa: E402
from framestep.hal.rp2 import Rp2Hal  # noqa: E402

hal = None
controller = None


def start():
    """Bring the board up. A wrong rig file is told on the REPL; then the board answers, but moves nothing."""
    global hal, controller
    settings, mistake = rig.load(board=BOARD)
    if mistake:
        print("framestep:", mistake)
        print("framestep: nothing will move until the file is right and the board has been reset")
    hal = Rp2Hal(BOARD, settings)
    controller = Controller(hal, settings, broken=mistake is not None)
    gc.threshold(-1)
    hal.start()
    hal.run(controller)
