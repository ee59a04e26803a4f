"""`make profile`: where the processor's time goes, in the scenarios of `make bench`."""

from enum import Enum
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from framestep_emulator.profile import Profile

from ..building import images
from ..errors import Command
from ..payloads import MotorStatus, RtGo
from ..simulator.boards import EmulatedBoard
from . import replies
from .measure import PULSE_US, upload_rate
from .moves import CLOCK_MHZ, MOTORS, STEADY_RATES, mixed_move
from .session import Session

_OURS = "fun_data_framestep_"  # prefix of the symbols of frozen code
SERVO_CASES = ((1, 50), (4, 50), (8, 50), (4, 333))  # number of servos, rate of their pulses in Hz
_UPLOAD_FRAMES = {"upload": 3000, "single-port": 500}


class Scenario(str, Enum):
    """Scenarios to profile."""

    UPLOAD = "upload"
    SINGLE_PORT = "single-port"
    PLAY = "play"
    GO = "go"
    SERVOS = "servos"
    ANSWERS = "answers"


def _play(session: Session, profile: Profile, wait_s: float, seconds: float) -> None:
    """Profile some seconds of the mixed move, from `wait_s` after GO, with requests at random
    moments."""
    client = session.client
    session.prepare(mixed_move(), max(STEADY_RATES) * 11 // 10)
    random = np.random.default_rng(1)
    client.pump(0.2)
    go = client.send(RtGo())
    client.pump(wait_s)
    begun = client.clock()
    with profile:
        while client.clock() - begun < seconds:
            client.pump(random.uniform(0.001, 0.02))
            client.request(MotorStatus())
    client.answer_to(go)


def _interrupts(servos: int, rate_hz: int, args: list[str]) -> tuple[float, float]:
    """Measure the timers' interrupts of a board whose last motors are servos, all at rest.

    Returns µs in each ms, and interrupts per ms.
    """
    servo = {"servo": {"at_start": "on", "rate_hz": rate_hz}}
    rig = {"clock_mhz": CLOCK_MHZ, "motors": [{}] * (MOTORS - servos) + [servo] * servos}
    with EmulatedBoard(rig, trace=False, args=args) as board:
        board.emulator.advance(1000)
        with board.emulator.measure() as measured:
            board.emulator.advance(2000)
    timer = measured["exceptions"]["irq3"]
    return timer["cycles"] / CLOCK_MHZ / measured["ms"], timer["count"] / measured["ms"]


def servo_table(args: list[str]) -> Table:
    """Return a table of the cost of servos, whose pulses a second timer starts, in µs of each
    ms."""
    table = Table(
        f"servos of {MOTORS} motors", "Hz", "interrupts per ms", "µs per ms", "µs more than none"
    )
    none, count = _interrupts(0, 50, args)
    table.add_row("0", "-", f"{count:.2f}", f"{none:.1f}", "0.0")
    for servos, rate_hz in SERVO_CASES:
        us, count = _interrupts(servos, rate_hz, args)
        table.add_row(str(servos), str(rate_hz), f"{count:.2f}", f"{us:.1f}", f"{us - none:.1f}")
    return table


def tables(profile: Profile, rows: int) -> tuple[Table, Table]:
    """Return tables of the time per millisecond, by Python function and by firmware function."""
    python = Table("Python function", "calls per ms", "own, µs per ms", "with calls")
    for function in profile.functions[:rows]:
        figures = function.calls, function.own_us, function.inner_us
        python.add_row(
            function.name.removeprefix(_OURS), *(f"{figure / profile.ms:.2f}" for figure in figures)
        )
    firmware = Table("function of the firmware", "own, µs per ms")
    for name, us in list(profile.firmware.items())[:rows]:
        firmware.add_row(name.removeprefix(_OURS), f"{us / profile.ms:.2f}")
    return python, firmware


app = Command("profile")


@app.command()
def main(
    scenario: Annotated[Scenario, typer.Argument(help="what to profile")],
    rows: Annotated[int, typer.Option(help="lines of each table", min=1)] = 40,
    cache: Annotated[bool, typer.Option(help="with the model of the flash cache")] = True,
) -> None:
    """Print where the processor's time goes: in an upload, in an upload through a single port, in a
    move, just after GO; or the cost of servos; or how long answers take in each state."""
    rig: dict[str, Any] = {"clock_mhz": CLOCK_MHZ, "motors": [{"pulse_us": PULSE_US}] * MOTORS}
    if scenario is Scenario.SINGLE_PORT:
        rig["ports"] = 1
    args = [] if cache else ["--xip-miss", "0"]
    elf = images.frozen().with_name("firmware.elf")
    console = Console(width=120, highlight=False)
    if scenario is Scenario.SERVOS:
        console.print(servo_table(args))
        return
    if scenario is Scenario.ANSWERS:
        for name, mhz in replies.BOARDS:
            for table in replies.tables(name, mhz, args):
                console.print(table)
        return
    with EmulatedBoard(rig, trace=False, args=args) as board:
        session = Session(board)
        profile = Profile(board.emulator, elf)
        if scenario is Scenario.PLAY:
            _play(session, profile, 0.3, 1.5)
        elif scenario is Scenario.GO:
            _play(session, profile, 0, 0.02)
        else:
            rate = upload_rate(session, _UPLOAD_FRAMES[scenario.value], profile)
            console.print(f"{rate:,.0f} bytes/s".replace(",", " "))
    console.print(f"{profile.ms:.1f} ms of the emulated clock")
    for table in tables(profile, rows):
        console.print(table)


if __name__ == "__main__":
    app()
