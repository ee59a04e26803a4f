"""hal/contract.py describes what the HALs have, and all that is used of them.

A board's HAL can be imported only on a board, so these tests read source.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from framestep_tools.building.board_files import FIRMWARE
from framestep_tools.chips import chips

HAL = FIRMWARE / "framestep" / "hal"
CONTRACT = HAL / "contract.py"
IMPLEMENTED = {
    "Hal": ["rp2/hal.py:Rp2Hal", "esp32/hal.py:Esp32Hal", "host.py:HostHal"],
    "PulseEngine": ["rp2/pulses.py:PulseEngine", "stream.py:Stream"],
    "Port": [
        "ports/usb_port.py:UsbPort", "ports/stdin_port.py:StdinPort", "esp32/port.py:UartPort",
        "esp32/usb_port.py:OwnPort", "host.py:HostPort",
    ],
    "Dmx": ["rp2/dmx.py:Dmx", "esp32/dmx.py:Dmx", "host.py:HostDmx", "absent.py:NoDmx"],
    "Watchdog": [
        "rp2/watchdog.py:Watchdog",
        "esp32/watchdog.py:Watchdog",
        "host.py:HostWatchdog",
        "absent.py:NoWatchdog",
    ],
    "DriverWire": [
        "rp2/wire.py:Wire", "rp2/one_wire.py:OneWire", "esp32/wire.py:Wire", "host.py:SilentWire",
    ],
    "Flash": ["flash.py:Flash", "host.py:HostFlash"],
}  # fmt: skip
# what a port over another one has from that one
INHERITED = {"send", "open", "openings", "answer", "glance", "look_for_stop", "struck"}
# Parts that only one kind has, or that another class provides. The host's HAL has no REPL, nor a
# single object that models engine commands.
WITHOUT = {
    "host.py:HostHal": {"engine", "inside", "passes", "pass_callback"},
    "host.py:HostPort": {"stop", "struck"},
    "ports/stdin_port.py:StdinPort": {"struck"},
    "ports/usb_port.py:UsbPort": {"stop"},
    "esp32/port.py:UartPort": {"start"} | INHERITED,  # StdinPort's
    "esp32/usb_port.py:OwnPort": INHERITED,  # UsbPort's
}
# Names by which the other layers call each kind: the part before the dot
CALLED = {
    "hal": "Hal", "port": "Port", "dmx": "Dmx", "dog": "Watchdog", "driver_wire": "DriverWire",
    "flash": "Flash",
}  # fmt: skip


def classes(path: Path) -> dict[str, ast.ClassDef]:
    return {
        node.name: node
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.ClassDef)
    }


def methods(cls: ast.ClassDef) -> dict[str, list[str]]:
    """Return {name: parameters, without self}; a name that is assigned as a whole has no list to
    compare."""
    return {
        node.name: [arg.arg.lstrip("_") for arg in node.args.args[1:]]
        for node in cls.body
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("__")
    }


def attributes(cls: ast.ClassDef) -> set[str]:
    """Return the names set on the object or in the class, including properties."""
    found = set()
    for node in ast.walk(cls):
        match node:
            case ast.Attribute(value=ast.Name(id="self"), attr=name, ctx=ast.Store()):
                found.add(name)
            case ast.Assign(targets=[ast.Name(id=name)]) if node in cls.body:
                found.add(name)
            case ast.FunctionDef(name=name, decorator_list=[ast.Name(id="property")]):
                found.add(name)
    return found


def documented(cls: ast.ClassDef) -> set[str]:
    """Return the attributes listed in the docstring: a name, two or more spaces, its meaning."""
    lines = (ast.get_docstring(cls) or "").splitlines()
    return {
        line.split()[0] for line in lines[1:] if "  " in line.strip() and not line.startswith(" ")
    }


def implementations() -> Iterator[tuple[str, str]]:
    for base, places in IMPLEMENTED.items():
        for place in places:
            yield base, place


def test_every_chip_is_held_to_the_contract():
    """The classes of its HAL are in the table above."""
    held = {
        place.split(":")[0]
        for base in ("Hal", "PulseEngine", "Port")
        for place in IMPLEMENTED[base]
    }
    for key, chip in chips().items():
        assert f"{chip.hal}/hal.py" in held, (
            f"{key}: add the classes of hal/{chip.hal}/ to IMPLEMENTED in this file"
        )


@pytest.mark.parametrize("hal", sorted({chip.hal for chip in chips().values()} | {"esp32"}))
def test_every_hal_has_a_start(hal):
    """The module has the contract's names; boot.py uses all of them."""
    contract = classes(CONTRACT)["Start"]
    tree = ast.parse((HAL / hal / "start.py").read_text())
    found = {
        node.name: [arg.arg for arg in node.args.args]
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
    }
    others = {
        alias.asname or alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    wanted = {
        node.name: [arg.arg for arg in node.args.args]
        for node in contract.body
        if isinstance(node, ast.FunctionDef)
    }
    for name, parameters in wanted.items():
        assert name in others or found.get(name) == parameters, f"hal/{hal}/start.py: {name}"
    boot = ast.parse((FIRMWARE / "framestep" / "boot.py").read_text())
    used = {
        node.attr
        for node in ast.walk(boot)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "chip"
    }
    assert used == wanted.keys() | documented(contract)


@pytest.mark.parametrize(("base", "place"), list(implementations()))
def test_every_hal_has_what_the_contract_says(base, place):
    file, name = place.split(":")
    contract, cls = classes(CONTRACT)[base], classes(HAL / file)[name]
    without = WITHOUT.get(place, set())
    has = methods(cls)
    given = attributes(cls)
    for method, parameters in methods(contract).items():
        if method in has:
            assert has[method][: len(parameters)] == parameters, f"{place}.{method}"
        else:
            assert method in given or method in without, f"{place} has no {method}()"
    for attribute in documented(contract):
        assert attribute in given | has.keys() | without, f"{place} has no {attribute}"


def users() -> Iterator[Path]:
    for path in sorted((FIRMWARE / "framestep").rglob("*.py")):
        if HAL not in path.parents and path.name != "host_board.py":
            yield path


def used() -> Iterator[tuple[str, int, str, str]]:
    """Yield where something of a HAL is used: file, line, kind, name."""
    for path in users():
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Attribute):
                continue
            match node.value:
                case ast.Attribute(
                    value=ast.Attribute(attr="hal" | "_hal") | ast.Name(id="hal"), attr="watchdog"
                ):
                    name = "dog"
                case ast.Name(id=name) | ast.Attribute(attr=name):
                    name = name.lstrip("_")
                case _:
                    continue
            if name in CALLED:
                yield path.relative_to(FIRMWARE).as_posix(), node.lineno, CALLED[name], node.attr


def test_nothing_else_is_used():
    contract = classes(CONTRACT)
    known = {name: documented(cls) | methods(cls).keys() for name, cls in contract.items()}
    seen = {kind: set() for kind in known}
    for file, line, kind, name in used():
        assert name in known[kind], f"{file}:{line} uses {name} of {kind}"
        seen[kind].add(name)
    assert len(seen["Hal"]) > 20
    assert seen["Port"] >= {"poll", "send", "open", "openings"}


def test_nothing_is_in_it_that_nobody_uses():
    """Of the HAL itself; Port and the like are passed to others under other names."""
    seen = {name for _, _, kind, name in used() if kind == "Hal"}
    cls = classes(CONTRACT)["Hal"]
    # for commands of the bench and tests
    assert (documented(cls) | methods(cls).keys()) - seen <= {"engine"}
