"""Where the processor's time goes on the emulated board, by Python function and by function of the firmware.

    .cache/venv/bin/python -m framestep_tools.profile upload

The firmware is the frozen image, and what is profiled is what `make bench` measures. Times are per millisecond; a
Python function's own time has in it what MicroPython does for it (looking up names, calling).
"""

import bisect
import subprocess
from collections import defaultdict
from enum import Enum
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from . import bench, builds
from .boards import EmulatedBoard
from .errors import Command, ToolError
from .payloads import MotorStatus, RtGo

_ENTRANCES = ("fun_viper_call", "fun_native_call", "fun_asm_call")  # called with the function
_STATES = ("mp_execute_bytecode",)  # called with a code state
_PER_MS = 125_000  # cycles


class Scenario(str, Enum):
    """What is profiled."""

    upload = "upload"
    single_port = "single-port"
    play = "play"
    go = "go"


class Symbols:
    """Names of the addresses of a firmware."""

    def __init__(self, elf: str):
        lines = subprocess.run(["arm-none-eabi-nm", "-n", elf], capture_output=True, text=True, check=True).stdout
        found = [line.split() for line in lines.splitlines()]
        pairs = [(int(f[0], 16), f[2]) for f in found if len(f) == 3 and not f[2].startswith("$")]
        self.addresses = [address for address, _ in pairs]
        self.names = [name for _, name in pairs]

    def address(self, name: str) -> int | None:
        """Where a symbol lies, if there is one."""
        return self.addresses[self.names.index(name)] if name in self.names else None

    def name(self, address: int) -> str:
        """The symbol that an address lies in."""
        return self.names[bisect.bisect_right(self.addresses, address) - 1].removeprefix("fun_data_framestep_")


class Profiler:
    """Profiles a board within its context, and prints what was found."""

    def __init__(self, board: EmulatedBoard, console: Console, rows: int):
        self.console, self.rows = console, rows
        self.emulator = board.emulator
        self.symbols = Symbols(str(builds.frozen().with_suffix(".elf")))
        self.ms = 0.0

    def __enter__(self) -> None:
        entrances, states = (
            [address for name in names if (address := self.symbols.address(name)) is not None]
            for names in (_ENTRANCES, _STATES)
        )
        self.emulator.cmd("profile", on=True, entrances=entrances, states=states)
        self.ms = self.emulator.ns / 1e6

    def __exit__(self, *_: object) -> None:
        console, rows = self.console, self.rows
        self.ms = self.emulator.ns / 1e6 - self.ms
        found: dict[str, Any] = self.emulator.cmd("profile", on=False)
        total: defaultdict[str, float] = defaultdict(float)
        for address, cycles in found["addresses"]:
            total[self.symbols.name(address)] += cycles
        scale = 1000 / _PER_MS / self.ms
        console.print(f"{self.ms:.1f} ms; times in µs per ms")
        table = Table("Python function", "calls per ms", "own", "with calls")
        for code, calls, own, inner in sorted(found["functions"], key=lambda f: -f[2])[:rows]:
            table.add_row(
                self.symbols.name(code), f"{calls / self.ms:.2f}", f"{own * scale:.1f}", f"{inner * scale:.1f}"
            )
        console.print(table)
        table = Table("function of the firmware", "own")
        for name, cycles in sorted(total.items(), key=lambda f: -f[1])[:rows]:
            table.add_row(name, f"{cycles * scale:.1f}")
        console.print(table)


def _play(session: bench.Session, profiler: Profiler, wait_s: float, seconds: float) -> None:
    """Profile so many seconds of the mixed move from a moment after GO on, with requests at random moments."""
    client = session.client
    session.prepare(bench.mixed_move(), max(bench.STEADY_RATES) * 11 // 10)
    random = np.random.default_rng(1)
    client.pump(0.2)
    go = client.send(RtGo())
    client.pump(wait_s)
    begun = client.clock()
    with profiler:
        while client.clock() - begun < seconds:
            client.pump(random.uniform(0.001, 0.02))
            client.request(MotorStatus())
    client.answer_to(go)


app = Command("profile")


@app.command()
def main(
    scenario: Annotated[Scenario, typer.Argument(help="what to profile")],
    rows: Annotated[int, typer.Option(help="lines of each table")] = 60,
    cache: Annotated[bool, typer.Option(help="with the model of the flash cache")] = True,
) -> None:
    """Print where the processor's time goes."""
    console = Console(width=120)
    rig: dict[str, Any] = {"motors": [{"pulse_us": bench.PULSE_US}] * bench.MOTORS}
    if scenario is Scenario.single_port:
        rig["ports"] = 1
    args = [] if cache else ["--xip-miss", "0"]
    with EmulatedBoard(rig, trace=False, frozen=True, args=args) as board:
        session = bench.Session(board)
        profiler = Profiler(board, console, rows)
        if scenario is Scenario.play:
            _play(session, profiler, 0.3, 1.5)
        elif scenario is Scenario.go:
            _play(session, profiler, 0, 0.02)
        else:
            console.print(f"{bench.upload_rate(session, 500 if rig.get('ports') else 3000, profiler):.0f} bytes/s")


if __name__ == "__main__":
    app()
