"""Modules in /overlay replace the image's. If the board cannot start with them, it starts without
them. `framestep flash` puts them there."""

from types import SimpleNamespace

import pytest

from framestep.protocol import messages as m
from framestep_emulator import Emulator, edge_times
from framestep_tools import builds, cli, overlay
from framestep_tools.client import Client
from framestep_tools.files import board_modules, board_sources, compiled
from framestep_tools.payloads import GetCondition, Hi, MotorMove, MotorSetSpeed

BACKLASH = "framestep/motors/backlash.mpy"
TICK = "framestep/motion/tick.mpy"
STEP = 2  # the pin of motor 1
UP = "if load_position > planned[_LOAD_POSITION]:\n        planned[_OFFSET] = "
RAM, RAM_SIZE = 0x20000000, 256 * 1024
CODE_OF_A_FUNCTION = 12


@pytest.fixture(scope="module")
def firmware():
    return builds.frozen("pico")


def ident_of(board):
    """ID of a board's image, as framestep_image has it."""
    return builds.image_module(board, board_modules("armv6m", board)).split("'")[1]


@pytest.fixture(scope="module")
def ident(firmware):
    return ident_of("pico")


def edited(name, more="", old="", new=""):
    """A module with a text replaced, and lines added at its end."""
    source = board_sources("pico")[name].decode()
    assert not old or source.count(old) == 1
    text = (source.replace(old, new) + more).encode()
    return compiled(name.replace(".mpy", ".py"), text, "armv6m")


def on_board(ident, modules):
    """Files of a board with this overlay."""
    listing = " ".join([ident, *map(overlay.dotted, modules)]).encode()
    files = {f"{overlay.FOLDER}/{name}": content for name, content in modules.items()}
    return {**files, overlay.LIST: listing}


def seven_more(more=""):
    """backlash.py that makes seven steps more going up."""
    return {BACKLASH: edited(BACKLASH, more, UP + "0", UP + "7")}


def pulses(emu):
    """Pulses that 500 steps make."""
    with Client(emu.serial(1)) as client:
        client.request(Hi())
        emu.trace_start([STEP])
        client.request(MotorMove(1, 500))
        client.wait_idle()
        client.pump(0.1)
    return len(edge_times(emu.trace_stop(), STEP, 1))


def condition(emu):
    with Client(emu.serial(1)) as client:
        return client.request(GetCondition()).bits


def test_modules_of_an_overlay_run(firmware, ident):
    """They import frozen modules of their own package, and the other way round; one that is
    compiled into RAM, and after a soft reset too."""
    files = on_board(ident, {**seven_more(), TICK: edited(TICK)})
    with Emulator(firmware, files=files) as emu:
        emu.wait_usb(10_000, ports=2)
        assert pulses(emu) == 507
        assert condition(emu) == m.CONDITION_OVERLAY
        repl = emu.repl()
        where = "[sys.modules['framestep.motors' + m].__file__ for m in ('.backlash', '.bounds')]"
        expected = [f"{overlay.FOLDER}/{BACKLASH}", "framestep/motors/bounds.py"]
        assert repl.eval(f"[sys := __import__('sys'), {where}][1]") == expected
        tick = "__import__('framestep.motion.tick', None, None, ('Header',))"
        assert repl.eval(f"{tick}.__file__") == f"{overlay.FOLDER}/{TICK}"
        code = repl.eval(
            f"__import__('machine').mem32[id({tick}.Header.tick) + {CODE_OF_A_FUNCTION}]"
        )
        assert RAM <= code < RAM + RAM_SIZE
        assert "an overlay is in use" in repl.exec("from framestep.repl import *\nstatus()")
        repl.serial.write(b"\r\x03\x02\x04")  # a soft reset
        emu.advance(3000)
        assert pulses(emu) == 507


HANG = """
import machine
machine.disable_irq()
@micropython.viper
def _loop():
    i = 1
    while i:
        i = 1
_loop()
"""


@pytest.mark.parametrize(
    ("more", "why"),
    [("1 // 0\n", "ZeroDivisionError"), (HANG, "the start hung")],
    ids=["raises", "hangs"],
)
def test_an_overlay_that_cannot_start_is_left_out(firmware, ident, more, why):
    with Emulator(firmware, files=on_board(ident, seven_more(more))) as emu:
        emu.wait_usb(15_000, ports=2)
        assert pulses(emu) == 500
        assert condition(emu) == m.CONDITION_OVERLAY_LEFT_OUT
        repl = emu.repl()
        assert why in repl.eval(f"open({overlay.FAILED!r}).read()")
        assert "modules" not in repl.eval(f"__import__('os').listdir({overlay.FOLDER!r})")


@pytest.mark.parametrize(
    "listing", [b"00000000 framestep.motors.backlash", b"\xff", None], ids=repr
)
def test_an_overlay_for_another_image_or_incomplete_is_left_out(firmware, listing):
    files = on_board("", seven_more())
    del files[overlay.LIST]
    if listing is not None:
        files[overlay.LIST] = listing
    with Emulator(firmware, files=files) as emu:
        emu.wait_usb(10_000, ports=2)
        assert pulses(emu) == 500
        assert condition(emu) == m.CONDITION_OVERLAY_LEFT_OUT


# ---- framestep flash


@pytest.fixture(scope="module")
def bench(firmware):
    """A board with the image that runs no faster than a real one."""
    with (
        Emulator(
            firmware, files={"/rig.json": b'{"name": "my crane"}'}, lockstep=False, speed=1
        ) as emu,
        emu.pty(0) as repl,
        emu.pty(1) as protocol,
    ):
        emu.wait_usb()
        yield SimpleNamespace(emu=emu, repl=repl, protocol=protocol)


@pytest.fixture
def flash(bench, capsys, monkeypatch):
    """Run the command as if these modules had been edited; return what it prints."""

    def run(*options, status=0, **changes):
        changes = {name.replace("__", "/") + ".mpy": text for name, text in changes.items()}
        modules = board_modules("armv6m", "pico") | changes
        monkeypatch.setattr(overlay, "board_modules", lambda *_: modules)
        args = ["flash", "--port", bench.repl, "--protocol", bench.protocol, *options]
        result = cli.app.status(args)
        said = "".join(capsys.readouterr())
        assert result == status, said
        return said

    return run


def steps(bench):
    with Client.open(bench.protocol) as client:
        client.request(MotorSetSpeed(1, 2000, 10_000))
        bench.emu.trace_start([STEP])
        client.request(MotorMove(1, 500))
        client.wait_idle()
        client.pump(0.1)
    return len(edge_times(bench.emu.trace_stop(), STEP, 1))


def test_flash_copies_what_was_edited_and_takes_it_away(bench, flash):
    """An edit, the same again, one that cannot start, a clean board."""
    good = seven_more()[BACKLASH]
    said = flash(framestep__motors__backlash=good)
    assert "copying 1/1 /overlay/framestep/motors/backlash.mpy" in said
    assert "my crane on" in said
    assert steps(bench) == 507
    said = flash(framestep__motors__backlash=good)
    assert "copying" not in said
    assert "(1 modules) is on the board" in said
    broken = seven_more("raise RuntimeError('mistake')\n")[BACKLASH]
    assert "RuntimeError: mistake" in flash(framestep__motors__backlash=broken, status=1)
    assert steps(bench) == 500
    flash("--clean")
    assert "overlay" not in bench.emu.repl().eval("__import__('os').listdir('/')")
    assert flash().count("no overlay is on the board") == 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"framestep__leftovers": b"x"}, "an overlay cannot replace this"),
        ({"framestep__motors__axis": bytes(50_000)}, "much for an overlay"),
    ],
    ids=["fixed", "large"],
)
def test_flash_refuses_what_an_overlay_cannot_do(flash, changes, message):
    said = flash(status=1, **changes)
    assert message in said
    assert "framestep install --board pico" in said
