"""Make the tables of measured figures in docs/internals/esp32.md (a minute).

python -m framestep_tools.documents.esp32_tables
"""

from collections.abc import Callable, Mapping
from typing import Any

from framestep.rig.settings import SETTINGS

from ..bench import stream_cost
from ..bench.esp32 import ChainSession
from ..bench.esp32_memory import fits, memory
from ..building.board_files import ROOT
from ..simulator.esp32_board import Esp32Board

PAGE = ROOT / "docs" / "internals" / "esp32.md"
_BEGIN = "<!-- {}: made by python -m framestep_tools.documents.esp32_tables -->\n"
_END = "<!-- end of {} -->"
_FRAMES, _MOTORS = 1000, 8
_BAUDS: tuple[int, ...] = SETTINGS["uart_baud"][1]  # type: ignore[assignment]
_RING = 260  # bytes of MicroPython's ring for the console
_STEP_KB = 8
_RIGS: tuple[tuple[str, Mapping[str, Any]], ...] = (
    ("eight motors, all types of virtual axes, DMX", {}),
    ("without DMX", {"dmx": False}),
    ("without virtual axes", {"virtuals": 0}),
    ("without both", {"virtuals": 0, "dmx": False}),
    ("one motor, without both", {"motor_count": 1, "virtuals": 0, "dmx": False}),
    ("remembered positions", {"remember_positions": True}),
    (
        "four drivers with a UART, homing",
        {
            "limits": [{"low": 25}],
            "motors": [{"driver": {"run_ma": 500}, "home": {"limit": 1, "travel": 1000}}]
            + [{"driver": {"run_ma": 500}}] * 3,
        },
    ),
)


def _grouped(value: float) -> str:
    return f"{round(value):,}".replace(",", " ")


def _upload_s(baud: int) -> float:
    with Esp32Board({"uart_baud": baud}, baud=baud) as board:
        client = ChainSession(board).client
        began = client.clock()
        # each position is far from the one before, so it takes the most bytes
        there = [1000 * frame * (-1) ** frame for frame in range(_FRAMES)]
        client.upload_move(1, _FRAMES, dict.fromkeys(range(1, _MOTORS + 1), there), window=4)
        return client.clock() - began


def rates() -> str:
    """Return a table of the port's rates."""
    lines = [
        f"| `uart_baud` | an upload of {_MOTORS} motors × {_FRAMES} frames "
        "| a pause of the main loop that loses no byte |",
        "|---|---|---|",
    ]
    for baud in _BAUDS:
        lines.append(f"| {baud} | {_upload_s(baud):.2g} s | {_RING * 10_000 / baud:.1f} ms |")
    return "\n".join(lines) + "\n"


def costs() -> str:
    """Return a table of what a millisecond of the stream costs."""
    lines = ["| steps/s of each of eight motors | µs for each millisecond, at best |", "|---|---|"]
    for rate in (1000, 20_000, 60_000):
        lines.append(f"| {_grouped(rate)} | {_grouped(stream_cost.us(rate))} |")
    return "\n".join(lines) + "\n"


def _least_kb(rig: Mapping[str, Any], most: int) -> int:
    low, high = 0, most // _STEP_KB  # it does not fit, it fits
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if fits(rig, middle * _STEP_KB) else (middle, high)
    return high * _STEP_KB


def memories() -> str:
    """Return a table of the memory that rigs take."""
    lines = [
        "| rig | heap besides the move | machine code | starts with a heap of | frames in 2 MB |",
        "|---|---|---|---|---|",
    ]
    for name, rig in _RIGS:
        found = memory(rig)
        least = _least_kb(rig, 512)
        lines.append(
            f"| {name} | {_grouped(found.heap_bytes)} | {_grouped(found.code_bytes)} "
            f"| {least} kB | {_grouped(found.frames)} |"
        )
    return "\n".join(lines) + "\n"


TABLES: dict[str, Callable[[], str]] = {"rates": rates, "costs": costs, "memory": memories}


def put(text: str, name: str, table: str) -> str:
    """Return a page's text with another table."""
    begin, end = _BEGIN.format(name), _END.format(name)
    head, _, rest = text.partition(begin)
    _, found, tail = rest.partition(end)
    if not found:
        raise ValueError(f"{PAGE.name} has no place for {name}")
    return head + begin + table + end + tail


def main() -> None:
    text = PAGE.read_text()
    for name, make in TABLES.items():
        text = put(text, name, make())
    PAGE.write_text(text)


if __name__ == "__main__":
    main()
