"""The highest rates at which motors move with every edge right: with pulses, and with steps on both
edges.

Motors that step on both edges have a driver with a UART, of which a board has four. So that eight
can be measured, the running firmware gets the engine's other program, and its settings, from the
REPL.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from .moves import MOTORS, steady_move
from .session import Session

TOP_RATES = (
    500_000,
    475_000,
    450_000,
    425_000,
    400_000,
    375_000,
    350_000,
    325_000,
    300_000,
    250_000,
    200_000,
)
STEADY_US = 0.5  # by default a rate counts as reached if every edge is this close to the ideal
LEVEL_US = 1.5  # how long the step input needs each level
PULSES = tuple(rate for rate in TOP_RATES if rate <= 300_000)  # with widths as the engine has them
COUNTS = (8, 4, 2, 1)
_CHANGE = f"""
import machine
from framestep import boot
from framestep.pulse.shape import pulse_shape
hal = boot.hal
hz = machine.freq()
if hz > 131000000:
    hz //= 2
def change(both_edges):
    settings = {{"pulse_us": {LEVEL_US}, "setup_us": 5.0, "hold_us": 0.0, "invert": False}}
    settings["driver"] = {{"both_edges": both_edges}}
    shape = pulse_shape(settings, hz // 1000000)
    for i, step in enumerate(hal.board["step"]):
        if both_edges:
            from framestep.hal.rp2.edges import edge_machine
            hal.engine.machines[i].active(0)
            turn = machine.Pin(hal.board["dir"][i], machine.Pin.OUT, value=0)
            hal.engine.machines[i] = edge_machine(i, hz, step, turn)
            hal.engine.machines[i].active(1)
        hal.kernel.configure(i, hal.engine.fifo(i), *shape)
"""


def top_rate(
    session: Session,
    motors: int,
    say: Callable[[str], None],
    rates: Sequence[int] = TOP_RATES,
    within_us: float = STEADY_US,
    setting: int = TOP_RATES[0],
) -> float:
    """Return the highest of these rates at which `motors` motors play a move with every edge this
    close to the ideal. setting: the highest velocity that can be set."""
    for wanted in rates:
        say(f"{motors} motors at {wanted} steps/s")
        positions = session.prepare(
            steady_move(wanted, motors), min(wanted + wanted // 100, setting)
        )
        played = session.play(positions)
        worst = float(np.nanmax(played.errors_us(ramps=False)))
        if not played.complaints and worst <= within_us:
            return played.rate()
        say(f"  not reached: worst edge {worst:.2f} µs; {'; '.join(played.complaints[:2])}")
        session.client.wait_idle()
    return 0.0


def rates_by_edges(session: Session, say: Callable[[str], None]) -> dict[str, float]:
    """Return the highest rates, by their keys. Afterwards the motors step on both edges."""
    session.repl(_CHANGE)
    session.repl("change(False)")
    say(f"pulses of {LEVEL_US} µs")
    found = {"pulses_steps_per_s_8": top_rate(session, MOTORS, say, PULSES)}
    session.repl("change(True)")
    pins = session.board.pins
    session.board.pins = replace(pins, both_edges=frozenset(pins.step))
    say("steps on both edges")
    for motors in COUNTS:
        found[f"both_edges_steps_per_s_{motors}"] = top_rate(session, motors, say)
    return found
