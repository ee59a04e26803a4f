"""The command of `make bench`."""

import json
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from ..building import images
from ..building.board_files import ROOT
from ..errors import Command
from . import esp32, pico2, shift_registers, tick_cost
from .figures import FIGURES, TRUST, all_missed, keyed, missed, plain_table, table
from .main_loop import loop_table, loops
from .measure import QUICK, measure
from .record import IDEAL, RECORD, comparison, record, recorded, worse

BOARDS = ("pico", pico2.BOARD, shift_registers.BOARD)
RESULT = ROOT / "build" / "bench.json"
_WIDTH = 150  # of the table, if the output is not a terminal


app = Command("bench")


@app.command()
def main(
    explain: Annotated[
        bool, typer.Option("--explain", help="say how each figure is measured")
    ] = False,
    report: Annotated[
        bool, typer.Option("--report", help="end with status 0 even if goals are missed")
    ] = False,
    renew: Annotated[
        bool, typer.Option("--renew", help="record these figures; later ones must not be worse")
    ] = False,
    out: Annotated[Path, typer.Option(help="file for the figures", metavar="FILE")] = RESULT,
    page: Annotated[
        Path | None, typer.Option(help="file for a page about them in Markdown", metavar="FILE")
    ] = None,
) -> None:
    """Measure the firmware on the emulated board and the simulated ESP32 against its goals."""
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = _WIDTH
    console.print("making the frozen image, if it is not there (two minutes)")
    for board in BOARDS:
        images.frozen(board)
    began = time.monotonic()

    def saying(name: str) -> Callable[[str], None]:
        return lambda text: console.print(f"{time.monotonic() - began:5.0f} s  {name}: {text}")

    def run(mhz: int, cache: bool) -> dict[str, float]:
        name = f"{mhz} MHz, " + ("cache model on" if cache else "no cache misses")
        return measure(mhz, cache, saying(name))

    with ThreadPoolExecutor(2) as pool:
        newer = pool.submit(pico2.measured, saying("Pico 2"))
        registers = pool.submit(shift_registers.measured, saying("Pico 2 with shift registers"))
        slow, fast, ideal = pool.map(run, (125, 200, 125), (True, True, False))
    on_pico2, on_registers = newer.result(), registers.result()
    modelled = {125: slow, 200: fast}
    parts = tick_cost.both()
    passes = loops()
    console.print("the simulated ESP32")
    chain = esp32.measure()
    values = keyed(modelled) | on_pico2 | on_registers | chain
    values |= {key + IDEAL: ideal[key] for key in QUICK}
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(values, indent=2) + "\n")
    console.print(table(modelled, ideal, explain))
    console.print(loop_table(passes))
    console.print(tick_cost.table(parts))
    console.print(TRUST)
    console.print(plain_table(pico2.TITLE, pico2.FIGURES, on_pico2, explain))
    console.print(
        plain_table(shift_registers.TITLE, shift_registers.FIGURES, on_registers, explain)
    )
    console.print(plain_table(esp32.TITLE, esp32.FIGURES, chain, explain))
    console.print(f"figures with the cache model in {out}")
    lines = missed(modelled) + all_missed(pico2.FIGURES, on_pico2)
    lines += all_missed(shift_registers.FIGURES, on_registers)
    if renew:
        record(values)
        console.print(f"recorded in {RECORD}")
    figures = (*FIGURES, *pico2.FIGURES, *shift_registers.FIGURES, *esp32.FIGURES)
    if page:
        page.write_text(comparison(figures, values, recorded(), image_sizes()))
    lines += all_missed(esp32.FIGURES, chain)
    conclude(console, lines, worse(figures, values, recorded()), report)


def image_sizes() -> dict[str, tuple[int, int]]:
    """Return {board: (bytes of its image, bytes of flash left)} for a board of each chip."""
    firmware = {
        board: images.frozen(board).with_name("firmware.bin").read_bytes() for board in BOARDS
    }
    return {name: (len(found), images.flash_left(found)) for name, found in firmware.items()}


def conclude(
    console: Console, missing: list[str], worsened: list[str], report: bool = False
) -> None:
    """End with the goals that are missed and the figures that are worse than recorded, and with a
    status of 1 if there are any. report: missed goals do not count."""
    if not missing:
        console.print("all goals are reached")
    else:
        console.print(f"{len(missing)} goals are missed:")
    for line in missing:
        console.print(f"  {line}")
    if worsened:
        console.print(f"{len(worsened)} figures are worse than recorded (bench/record.json):")
    for line in worsened:
        console.print(f"  {line}")
    if worsened or (missing and not report):
        raise typer.Exit(1)


if __name__ == "__main__":
    app()
