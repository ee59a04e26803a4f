"""Check boards/<board>, and make from it what else the repository says of boards: the table of pins
and the drawing of each board's page, the lists of boards, and the figures of emulated boards.

python -m framestep_tools.documents.board_pages          bring all of them up to date
"""

import html
import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from framestep.rig.pins import fitted

from .. import paths
from ..building.board_files import ENGINES, board_chip, board_data, board_names
from ..chips import chips
from ..errors import Command, ToolError
from ..prove import measurement, report

COMMAND = "python -m framestep_tools.documents.board_pages"
# What is made stands in a file between a comment with "made by <COMMAND>" and one with "end of".
_MADE = re.compile(
    rf"^([^\n]*: made by {re.escape(COMMAND)}[^\n]*\n).*?(?=^[^\n]*end of (?:pins|boards)\b)",
    re.DOTALL | re.MULTILINE,
)
_ADDRESSES = 4  # that MS1 and MS2 of a TMC2209 can set

_KEYS = {
    *(
        "name",
        "chip",
        "clock_mhz",
        "motors",
        "step",
        "dir",
        "enable",
        "estop",
        "shutter",
        "meter",
        "dmx",
        "drivers",
        "gio",
    ),
    *(
        "outputs",
        "inputs",
        "stops",
        "led",
        "rgb",
        "jumper",
        "freed",
        "with_drivers",
        "page",
        "flash_mhz",
    ),
    *("chain", "buffers", "button", "uart", "usb", "flash"),
    *("engine", "registers"),
    *("hal", "ports", "pins", "clocks"),  # not in the file: board_files.board_data adds them
}
# Keys of `page`, and which of them every board has
_PAGE_KEYS = {"printed", "drivers", "costs", "header", "sockets", "labels", "variants"}
_PAGE_NEEDS = {
    "printed": "what a user reads on the board",
    "drivers": "the column in the table of boards/README.md",
}


_CHAIN = 64  # pin of the first output of a chain of shift registers
_OUTPUTS = {"chain": 30, "registers": 32}  # that framestep uses of four registers
_CLOCK, _LATCH, _DATA = (
    ("shift clock", "SRCLK (11) of every 74HC595"),
    ("shift latch", "RCLK (12) of every 74HC595"),
    ("shift data", "SER (14) of 74HC595 no. 1"),
)
_OE = ("shift OE", "OE (13) of every 74HC595, 10 kΩ to 3V3")
_LINES = {
    "chain": {"sck": _CLOCK, "ws": _LATCH, "sd": _DATA},
    "registers": {"data": _DATA, "clock": _CLOCK, "latch": _LATCH, "enable": _OE},
}


class Use(NamedTuple):
    """A pin's use, and what to wire to it."""

    pin: int
    kind: str  # uses of one kind look alike
    what: str
    wire: str


def uses(board: Mapping[str, Any]) -> list[Use]:
    """List all used pins in the order of the table. board: data from framestep.rig.pins.fitted."""
    found = list(_motors(board))
    if isinstance(board["enable"], int):
        found.append(Use(board["enable"], "motor", "enable of all drivers", "EN of every driver"))
    for key, kind, what, wire in (
        ("estop", "stop", "E-stop", "button to GND, closed while all is well"),
        ("shutter", "camera", "camera shutter", "optocoupler of the release cable"),
        ("meter", "camera", "camera meter", "optocoupler of its half-press"),
    ):
        if key in board:
            found.append(Use(board[key], kind, what, wire))
    found += [
        Use(pin, "stop", f"stop input {i}", "limit switch to GND")
        for i, pin in enumerate(board.get("stops", []), 1)
    ]
    found += [
        Use(board[kind][key], "serial", what, "on the board" if _on_board(board) else wire)
        for kind, lines in _LINES.items()
        if kind in board
        for key, (what, wire) in lines.items()
    ]
    line = board.get("dmx")
    if line:
        found.append(Use(line["tx"], "serial", "DMX", "DI of a MAX485"))
        found.append(Use(line["rx"], "serial", "taken by the UART of DMX", "nothing"))
    line = board.get("drivers")
    if line and "pins" in line:
        for i, pin in enumerate(line["pins"], 1):
            found.append(Use(pin, "serial", f"TMC2209 UART of motor {i}", "on the board"))
    elif line:
        on_board = _on_board(board)
        found.append(
            Use(
                line["tx"],
                "serial",
                "TMC2209 UART TX",
                "on the board" if on_board else "1 kΩ to PDN_UART",
            )
        )
        found.append(
            Use(line["rx"], "serial", "TMC2209 UART RX", "on the board" if on_board else "PDN_UART")
        )
    pins = board.get("gio", [])
    outputs = board.get("outputs", []) + pins[: len(pins) // 2]
    inputs = pins[len(pins) // 2 :] + board.get("inputs", [])
    for i, pin in enumerate(outputs, 1):
        logic = pin in pins or pin >= _CHAIN
        wire = "3.3 V logic, a few mA" if logic else "low-side transistor, load to +"
        found.append(Use(pin, "gio", f"general output {i}", wire))
    found += [
        Use(pin, "gio", f"general input {i}", "contact to GND") for i, pin in enumerate(inputs, 1)
    ]
    for key, what, wire in (
        ("led", "LED", "on the board"),
        ("rgb", "RGB LED", "DIN of a WS2812 or its like"),
        ("jumper", "jumper", "to GND at power-up: main.py is skipped"),
        ("button", "BOOT", "hold it after a reset to get the REPL"),
    ):
        if key in board:
            found.append(Use(board[key], "board", what, wire))
    return found


def _on_board(board: Mapping[str, Any]) -> bool:
    """Return whether drivers and all that belongs to them are on the board."""
    return "sockets" in board.get("page", {})


def pin_name(pin: int) -> str:
    """Return a pin's name for people: an output of a 74HC595 is its number and letter as well."""
    if pin < _CHAIN:
        return f"GPIO {pin}"
    return f"{pin}: 595 no. {(pin - _CHAIN) // 8 + 1} Q{'ABCDEFGH'[(pin - _CHAIN) % 8]}"


def _motors(board: Mapping[str, Any]) -> Iterator[Use]:
    sockets = board.get("page", {}).get("sockets")
    address = board.get("drivers", {}).get("address", [])
    for i, (step, direction) in enumerate(zip(board["step"], board["dir"], strict=True)):
        own = f"driver {i + 1}" if sockets is None else f"socket {sockets[i]}"
        if i < len(address):
            own += f", address {address[i]}"
        yield Use(
            step, "motor", f"motor {i + 1} step", f"STEP of {own}" if sockets is None else own
        )
        yield Use(
            direction,
            "motor",
            f"motor {i + 1} direction",
            f"DIR of {own}" if sockets is None else own,
        )
        if isinstance(board["enable"], list):
            yield Use(board["enable"][i], "motor", f"motor {i + 1} enable", own)


# ---- the check -----------------------------------------------------------------------------------


def fits(board: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield each variant of a board's data that settings can select: (its name, the data)."""
    for count in range(1, board["motors"] + 1):
        for drivers in (False, True):
            yield (
                f"{count} motors{', drivers' if drivers else ''}",
                fitted(dict(board), count, drivers),
            )


def state_machines(board: Mapping[str, Any]) -> int:
    """Return the number of used state machines, counted from the first.

    A motor takes one. A driver's line takes two, from the next PIO block (of four) on. The RGB LED
    takes one, in the rest of the motors' last block or after all others. (Of a block's 32 words the
    steps take 14, the lines 11, the LED 12.)
    """
    wires = board.get("drivers", {}).get("pins", [])[: board["motors"]]
    count = board["motors"]
    light = 1 if "rgb" in board else 0
    if wires:
        if count % 4 and light:
            count, light = count + 1, 0
        count = -(-count // 4) * 4 + 2 * len(wires)
    return count + light


def complaints(board: Mapping[str, Any]) -> list[str]:
    """List the mistakes in a board's data as text; empty if it is valid."""
    page = board.get("page", {})
    found = [f"{key}: no such entry" for key in board if key not in _KEYS]
    found += [
        f"page.{key}: no such entry, only {', '.join(sorted(_PAGE_KEYS))}"
        for key in page
        if key not in _PAGE_KEYS
    ]
    found += [
        f"page.{key} is missing: {what}" for key, what in _PAGE_NEEDS.items() if key not in page
    ]
    if (mhz := board.get("flash_mhz", 133)) not in range(20, 134):
        found.append(f"flash_mhz: {mhz!r} is no whole number from 20 to 133")
    if board["chip"] not in chips():
        return [*found, f"chip: {board['chip']} is none of {', '.join(chips())}"]
    chip = chips()[board["chip"]]
    lengths = {len(board[key]) for key in ("step", "dir", "enable") if isinstance(board[key], list)}
    if lengths != {board["motors"]}:
        return [
            *found,
            f"motors: {board['motors']}, but step, dir and enable list {sorted(lengths)}",
        ]
    if board["clock_mhz"] not in chip.clocks:
        found.append(f"clock_mhz: {board['clock_mhz']}, but the chip runs at {chip.clocks}")
    if board.get("engine", chip.engine) not in ENGINES:
        found.append(f"engine: {board['engine']} is none of {', '.join(ENGINES)}")
    if "registers" in board:
        wires = board["registers"]
        if board.get("engine") != "registers" or wires["latch"] != wires["clock"] + 1:
            found.append(
                'registers: need "engine": "registers", and the latch at the pin after the clock'
            )
    elif board["motors"] > chip.motors:
        found.append(f"motors: {board['motors']}, but the chip has {chip.motors} state machines")
    for state, data in fits(board):
        counts = Counter(use.pin for use in uses(data))
        found += [f"{state}: pin {pin} is used {n} times" for pin, n in counts.items() if n > 1]
        found += [
            f"{state}: there is no pin {pin}"
            for pin in counts
            if pin not in range(chip.pins)
            and not any(
                kind in data and pin in range(_CHAIN, _CHAIN + count)
                for kind, count in _OUTPUTS.items()
            )
        ]
        lines = [data[key] for key in ("dmx", "drivers") if "uart" in data.get(key, {})]
        wires = data.get("drivers", {}).get("pins", [])
        if wires and len(wires) != board["motors"]:
            found.append(f"drivers: {len(wires)} pins for {board['motors']} motors")
        if "registers" not in data and state_machines(data) > chip.motors:
            extra = [f"{len(wires)} driver UARTs"] * bool(wires) + ["the RGB LED"] * ("rgb" in data)
            found.append(f"{state}: not enough state machines for {' and '.join(extra)}")
        for line in lines:
            uart = chip.uarts[line["uart"]]
            if line["tx"] not in uart["tx"] or line["rx"] not in uart["rx"]:
                found.append(
                    f"{state}: "
                    f"pins {line['tx']}, {line['rx']} are not TX and RX of UART{line['uart']}"
                )
        if len({line["uart"] for line in lines}) < len(lines):
            found.append(f"{state}: DMX and drivers on the same UART")
    for place in (board, board.get("with_drivers", {})):
        address = place.get("drivers", {}).get("address", [])
        shared = "pins" not in place.get("drivers", {})
        if (shared and len(set(address)) < len(address)) or not set(address) <= set(
            range(_ADDRESSES)
        ):
            found.append(
                f"drivers: addresses {address} are not different ones from 0 to {_ADDRESSES - 1}"
            )
    return list(dict.fromkeys(found))


# ---- the table -----------------------------------------------------------------------------------


def _rows(board: Mapping[str, Any], found: list[Use]) -> list[str]:
    labels = board.get("page", {}).get("labels", {})
    rows = ["| pin | use | wire to |", "|---|---|---|"]
    for use in found:
        label = labels.get(str(use.pin))
        name = pin_name(use.pin) + (f" ({label})" if label else "")
        rows.append(f"| {name} | {use.what} | {use.wire} |")
    return rows


def supplies(board: Mapping[str, Any]) -> list[str]:
    """Return the table's rows for wiring other than pins."""
    if "sockets" in board.get("page", {}):
        return [
            "| GND | common ground | GND of every switch, and of the motors' supply |",
            (
                "| – | pull-up of each driver's EN "
                "| look whether the board has them; else 10 kΩ from EN to 3.3 V |"
            ),
            (
                "| – | capacitor at VMOT "
                "| look whether the board has one for each driver; else 100 µF, 50 V |"
            ),
        ]
    chain = [
        "| 3V3 | supply of the shift registers | VCC (16) and SRCLR (10) of every 74HC595 |",
        f"| GND | | GND (8){' and OE (13)' * ('chain' in board)} of every 74HC595 |",
        "| – | from register to register | QH' (9) to SER (14) of the next, no. 1 to no. 4 |",
        "| – | capacitor at each register | 100 nF between VCC and GND |",
    ]
    pull_up = (
        "| – | pull-up of EN "
        "| 10 kΩ from EN to 3V3 (`enable_high`: 4.7 kΩ to GND), which keeps drivers off at first |"
    )
    return [
        *(chain if "chain" in board or "registers" in board else []),
        "| 3V3 | supply of the drivers' logic | VIO (VDD) of every driver; never VMOT |",
        (
            "| GND | common ground "
            "| GND next to VIO of every driver, of every switch, and of the motors' supply |"
        ),
        *([] if "chain" in board else [pull_up]),
        (
            "| – | capacitor at VMOT "
            "| 100 µF, 50 V between VMOT and GND of each driver, a few cm from it |"
        ),
    ]


def table(board: Mapping[str, Any]) -> str:
    """Return the pins as Markdown: first without a rig file, then the changes by settings."""
    plain = uses(fitted(dict(board)))
    lines = [*_rows(board, plain), *supplies(board)]
    for variant in board.get("page", {}).get("variants", []):
        data = fitted(dict(board), variant.get("motor_count", 0), variant.get("drivers", False))
        lines += [
            "",
            f"{variant['title']}:",
            "",
            *_rows(board, [use for use in uses(data) if use not in plain]),
        ]
    return "\n".join(lines) + "\n"


# ---- the drawing ---------------------------------------------------------------------------------

_ROW = 24
_COLOURS = {
    "motor": "#1f6fb4",
    "stop": "#c0392b",
    "camera": "#8e44ad",
    "serial": "#b9770e",
    "gio": "#1e8449",
    "board": "#566573",
}
_LEFT, _RIGHT = 380, 600  # edges of the board
_WIDTH = 980
_TOP = 70


class _Row(NamedTuple):
    label: str  # of the pin
    number: str  # of the pin in the header
    use: Use | None


def _columns(board: Mapping[str, Any], found: list[Use]) -> tuple[list[_Row], list[_Row]]:
    by_pin = {use.pin: use for use in found}
    page = board.get("page", {})
    if "header" in page:
        left, right = page["header"]
        rows = []
        for side, numbers in ((left, range(1, 21)), (right, range(40, 20, -1))):
            rows.append(
                [
                    _Row(
                        f"GP{name}" if name.isdigit() else name,
                        str(n),
                        by_pin.get(int(name)) if name.isdigit() else None,
                    )
                    for name, n in zip(side, numbers, strict=True)
                ]
            )
        return rows[0], rows[1]
    labels = page.get("labels", {})
    everything = [_Row(labels.get(str(use.pin), ""), pin_name(use.pin), use) for use in found]

    def on_the_left(use: Use) -> bool:
        return use.pin >= _CHAIN if board.keys() & _LINES.keys() else use.kind == "motor"

    return (
        [row for row in everything if row.use and on_the_left(row.use)],
        [row for row in everything if row.use and not on_the_left(row.use)],
    )


def _text(x: float, y: float, text: str, anchor: str = "start", **style: str) -> str:
    attributes = "".join(f' {key.replace("_", "-")}="{value}"' for key, value in style.items())
    return (
        f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}"{attributes}>{html.escape(text)}</text>'
    )


def drawing(board: Mapping[str, Any]) -> str:
    """Draw the board with its pins, their uses and their wiring, as SVG."""
    data = fitted(dict(board))
    columns = _columns(board, uses(data))
    height = _TOP + _ROW * max(map(len, columns)) + 60
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}"'
        ' font-family="sans-serif" font-size="12">',
        f'<rect width="{_WIDTH}" height="{height}" fill="#ffffff"/>',
        _text(_WIDTH / 2, 26, board["name"], "middle", font_size="18", font_weight="bold"),
        _text(
            _WIDTH / 2, 44, "drawn from its data; not tried on hardware", "middle", fill="#566573"
        ),
        f'<rect x="{_LEFT}" y="{_TOP - 14}" width="{_RIGHT - _LEFT}" height="{height - _TOP - 44}"'
        ' rx="10" fill="#eef3ee" stroke="#2c3e50" stroke-width="2"/>',
    ]
    for side, column in zip((-1, 1), columns, strict=True):
        edge = _LEFT if side < 0 else _RIGHT
        anchor, inner = ("end", "start") if side < 0 else ("start", "end")
        for i, row in enumerate(column):
            y = _TOP + _ROW * i + 4
            parts.append(
                _text(
                    edge - 14 * side,
                    y + 4,
                    f"{row.number} {row.label}".strip()
                    if side < 0
                    else f"{row.label} {row.number}".strip(),
                    inner,
                    fill="#2c3e50",
                )
            )
            colour = _COLOURS[row.use.kind] if row.use else "#b0b8bd"
            parts.append(f'<circle cx="{edge}" cy="{y}" r="5" fill="{colour}"/>')
            if row.use is None:
                continue
            end = edge + 34 * side
            parts.append(
                f'<path d="M{edge + 5 * side} {y}H{end}" stroke="{colour}" stroke-width="2"/>'
            )
            text = f"{row.use.what}: {row.use.wire}"
            parts.append(_text(end + 5 * side, y + 4, text, anchor, fill=colour))
    legend = (
        ("motor", "motors"),
        ("stop", "stops"),
        ("camera", "camera"),
        ("serial", "serial lines"),
        ("gio", "general inputs and outputs"),
        ("board", "others"),
    )
    x = 60
    for kind, word in legend:
        parts.append(f'<circle cx="{x}" cy="{height - 24}" r="5" fill="{_COLOURS[kind]}"/>')
        parts.append(_text(x + 10, height - 20, word, fill="#2c3e50"))
        x += 40 + 8 * len(word)
    return "\n".join([*parts, "</svg>"]) + "\n"


# ---- the files -----------------------------------------------------------------------------------


def filled(path: Path, made: str) -> str:
    """Return a file's text with `made` in the place for it."""
    text, count = _MADE.subn(lambda found: found[1] + made, path.read_text())
    if count != 1:
        raise ToolError(
            f'{path.relative_to(paths.ROOT)} needs one comment with "made by {COMMAND}" and '
            'below it one with "end of", as boards/pico/README.md has them'
        )
    return text


def without_made(text: str) -> str:
    """Return a file's text without what is made."""
    return _MADE.sub(lambda found: found[1], text)


def page(name: str) -> dict[Path, str]:
    """Return {file: text} of a board's page as it should be."""
    board, folder = board_data(name), paths.BOARDS / name
    readme = folder / "README.md"
    return {readme: filled(readme, table(board)), folder / "wiring.svg": drawing(board)}


def lists() -> dict[Path, str]:
    """Return {file: text} of the lists of boards as they should be: those with an image first."""
    boards = {name: board_data(name) for name in board_names()}
    image = {name: board_chip(name).uf2_family is not None for name in boards}
    rows, entries, options = "| board | motors | costs about | drivers | firmware |\n", "", ""
    rows += "|---|---|---|---|---|\n"
    for name, board in sorted(
        boards.items(), key=lambda item: (not image[item[0]], item[1]["name"])
    ):
        rows += (
            f"| [{board['name']}]({name}/README.md) | {board['motors']} "
            f"| {board['page'].get('costs', '–')} | {board['page']['drivers']} "
            f"| {'image' if image[name] else 'files for MicroPython'} |\n"
        )
        quoted = json.dumps(board["name"], ensure_ascii=False)  # YAML takes it as well
        entries += f"      - {quoted}: boards/{name}/README.md\n"
        options += f"        - {quoted}\n"
    made = {
        "boards/README.md": rows,
        "tools/framestep_tools/site/mkdocs.yml": entries,
        ".github/ISSUE_TEMPLATE/fault.yml": options,
    }
    return {paths.ROOT / file: filled(paths.ROOT / file, text) for file, text in made.items()}


def files() -> dict[Path, str]:
    """Return {file: text} of all that is made from the boards' folders, as it should be.

    Raises ToolError if a folder lacks a file, or its data have a mistake.
    """
    found: dict[Path, str] = {}
    for name in board_names():
        for file in ("README.md", "rig.json"):
            if not (paths.BOARDS / name / file).exists():
                raise ToolError(f"boards/{name} needs {file}: begin with another board's")
        for complaint in complaints(board_data(name)):
            raise ToolError(f"boards/{name}/board.json: {complaint}")
        found |= page(name)
    return found | lists()


def outdated() -> list[str]:
    """List what is not as it should be: files, and boards in the file of figures."""
    old = [path for path, text in files().items() if not path.exists() or path.read_text() != text]
    return [
        *(str(path.relative_to(paths.ROOT)) for path in old),
        *(f"{name} in {report.EMULATED.name}" for name in report.outdated()),
    ]


app = Command("board_pages")


@app.command()
def main() -> None:
    """Write all that is made from the boards' folders, and measure emulated boards that have no
    figures yet (minutes)."""
    for path, text in files().items():
        path.write_text(text)
    for name in report.outdated():
        measurement.renew(name, print)


if __name__ == "__main__":
    app()
