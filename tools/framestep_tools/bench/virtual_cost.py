"""Cost of the virtual axes' kinematics on the emulated board: `python -m
framestep_tools.bench.virtual_cost`.

It measures the memory of their modules and the time of an update. An update is the calculation for
a knot of a moving virtual axis: inverse() of a boom-swing-track pose with nodal offset, and
places(), the steps of the six motors, with a boom table. The time is the board's clock's.
"""

from collections.abc import Callable

from framestep.virtual_axes.registers import REGISTERS

from .virtual_precision import RIGS, read

UPDATES = 50
_BOARD = """
import gc, micropython, time
gc.collect()
from array import array
from framestep.virtual_axes.kinematics import boom_swing_track
from framestep.virtual_axes.kinematics.kinematics import Configuration
rig = boom_swing_track.Geometry(array("i", [0] * {registers}))
found = Configuration()
for to, numbers in zip((found.motors, found.steps_per_unit, found.positions, found.lengths), {numbers}):
    for i, number in enumerate(numbers):
        to[i] = number
found.table = {table}
found.table_at = 0
print(rig.configure(found, array("i", [20000, 60000, 1000000, 0, 20000, 0, 0, 0])))
out = array("i", [0] * 12)
def what(n):
    for _ in range(n):
        rig.inverse()
        rig.motor_steps(out, 0)
t = what(1)
micropython.heap_lock()
t = time.ticks_us()
what({updates})
t = time.ticks_diff(time.ticks_us(), t)
micropython.heap_unlock()
print(rig.inverse(), t)
print(out)
"""  # noqa: E501


def virtual_update_us(run: Callable[[str], str]) -> float:
    """Return the microseconds of an update. run: runs code on the board's REPL and returns the
    output."""
    found = read(RIGS["the same, boom table"])
    numbers = [
        list(n) for n in (found.motors, found.steps_per_unit, found.positions, found.lengths)
    ]
    table = bytes(found.table[found.table_at :][: 4 * 121])
    code = _BOARD.format(registers=REGISTERS, numbers=numbers, table=table, updates=UPDATES)
    answers = run(code).split()
    if answers[:2] != ["0", "0"]:
        raise ValueError(f"the board did not take the rig: {' '.join(answers)}")
    return int(answers[2]) / UPDATES


_MEMORY = """
import gc
def free():
    gc.collect()
    return gc.mem_free()
from framestep.protocol import frames
from framestep.motion import reals
a = free()
from framestep.motion import compute
from framestep.virtual_axes.kinematics import kinematics
b = free()
print("shared", a - b)
for name in ("aim", "x_y_z", "swing_pan", "y_swing_track", "boom_swing_track"):
    a = free()
    exec("from framestep.virtual_axes.kinematics import " + name)
    print(name, a - free())
"""


def memory(run: Callable[[str], str]) -> dict[str, int]:
    """Return bytes of a fresh board's memory by module. The common part of both arms counts for
    y_swing_track, the first."""
    return {name: int(size) for name, size in (line.split() for line in run(_MEMORY).splitlines())}


def main() -> None:
    from framestep_emulator import Emulator

    from ..building import images

    files = {"/main.py": b""}  # framestep does not start
    with Emulator(images.frozen(), files=files) as emulator:
        print(
            *(f"{name} {size}" for name, size in memory(emulator.repl().exec).items()),
            sep=" bytes, ",
            end=" bytes\n",
        )
    for label, args in (("", []), (", without the model of the flash cache", ["--xip-miss", "0"])):
        with Emulator(images.frozen(), files=files, args=args) as emulator:
            print(f"virtual_update_us {virtual_update_us(emulator.repl().exec):.0f}{label}")


if __name__ == "__main__":
    main()
