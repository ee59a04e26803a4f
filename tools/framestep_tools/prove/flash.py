"""Times of a board's flash to erase a sector and to program a page, each by itself.

This bypasses the file system, as framestep does for remembered positions
(firmware/framestep/hal/flash.py), and touches one sector of a file that it makes itself. The
file is one sector long, so it fills one; its random first bytes show which. If the power fails
meanwhile, only that file has lost its content. The next measurement writes it again.
"""

import ast
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..errors import ToolError

_ROUNDS = 5
# Pages in one call, whose own cost is the same as for one page. They are copied from the memory of
# uploaded moves, because the REPL has no free piece of this size
_PAGES = 9
_SCRIPT = """
import os, rp2
from time import ticks_diff, ticks_us
def prove_flash(rounds):
    head, look, page = os.urandom(16), bytearray(16), bytearray(256)
    times = []
    try:
        page[:16] = head
        begun = ticks_us()
        with open("/prove.tmp", "wb") as file:
            for _ in range(16):
                file.write(page)
                page[:16] = bytes(16)
        times.append(ticks_diff(ticks_us(), begun))
        flash, pages = rp2.Flash(), memoryview(store())[:{pages} * 256]
        found = []
        for place in range(flash.ioctl(4, 0)):
            flash.readblocks(place, look, 0)
            if look == head: found.append(place)
        if len(found) == 1:
            for _ in range(rounds):
                begun = ticks_us()
                flash.ioctl(6, found[0])
                erased = ticks_us()
                flash.writeblocks(found[0], page, 256)
                one = ticks_us()
                flash.writeblocks(found[0], pages, 512)
                done = ticks_us()
                times.append(ticks_diff(erased, begun))
                times.append(ticks_diff(one, erased))
                times.append(ticks_diff(done, one))
    except OSError as error: times = "%r" % error
    try: os.remove("/prove.tmp")
    except OSError: pass
    print(repr(times))
prove_flash({rounds})
del prove_flash
"""


class FlashTimes(NamedTuple):
    """Milliseconds to write a file of 4 kB, to erase a sector of 4 kB, to program a page of 256
    bytes. The last two are None if the file's sector was not found."""

    file_ms: float
    erase_ms: float | None
    program_ms: float | None


def measure(run: Callable[[str], str]) -> FlashTimes:
    """Measure on a board. run: an Instrument's, for its REPL. Raises ToolError if the file system
    has no room."""
    found = ast.literal_eval(run(_SCRIPT.format(rounds=_ROUNDS, pages=_PAGES)).strip())
    if isinstance(found, str):
        raise ToolError(f"the board cannot write a file of 4 kB ({found}): delete files on it")
    file, *rounds = (us / 1000 for us in found)
    if not rounds:
        return FlashTimes(file, None, None)
    erase, one, many = np.reshape(rounds, (-1, 3)).T
    page = (many.min() - one.min()) / (_PAGES - 1)  # the minimum: passes interrupted the others
    return FlashTimes(file, float(np.median(erase)), float(page))
