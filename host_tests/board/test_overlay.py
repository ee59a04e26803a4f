"""Modules in /overlay replace the image's. If the board cannot start with them, it starts without
them. test_flash.py tests the command that puts them there."""

import pytest

from framestep.protocol import messages as m
from framestep_emulator import Emulator, edge_times
from framestep_tools.board import overlay
from framestep_tools.building import images
from framestep_tools.client.client import Client
from framestep_tools.payloads import GetCondition, Hi, MotorMove
from host_tests.board.modules import edited, ident_of, on_board
from host_tests.selection import sweep

BACKLASH = "framestep/motors/backlash.mpy"
TICK = "framestep/pulse/tick.mpy"
STEP = 2  # the pin of motor 1
MOTOR = "        w[_MOTOR] = step + offset\n"
RAM, RAM_SIZE = 0x20000000, 256 * 1024
CODE_OF_A_FUNCTION = 12


@pytest.fixture(scope="module")
def firmware():
    return images.frozen("pico")


@pytest.fixture(scope="module")
def ident(firmware):
    return ident_of("pico")


def seven_more(more=""):
    """Return a backlash.py that makes seven steps more upward."""
    return {BACKLASH: edited(BACKLASH, more, MOTOR, MOTOR.replace("step", "7 + step"))}


def pulses(emu):
    """Return the pulses that 500 steps make."""
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
    """They import frozen modules of their own package, and these import them; one is compiled into
    RAM; after a soft reset, too."""
    files = on_board(ident, {**seven_more(), TICK: edited(TICK)})
    with Emulator(firmware, files=files) as emu:
        emu.wait_usb(10_000, ports=2)
        assert pulses(emu) == 507
        assert condition(emu) == m.CONDITION_OVERLAY
        repl = emu.repl()
        where = "[sys.modules['framestep.motors' + m].__file__ for m in ('.backlash', '.bounds')]"
        expected = [f"{overlay.FOLDER}/{BACKLASH}", "framestep/motors/bounds.py"]
        assert repl.eval(f"[sys := __import__('sys'), {where}][1]") == expected
        tick = "__import__('framestep.pulse.tick', None, None, ('Header',))"
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
    [
        pytest.param("1 // 0\n", "ZeroDivisionError", id="raises"),
        pytest.param(HANG, "the start hung", id="hangs", marks=pytest.mark.repeats),
    ],
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
    "listing", sweep([b"00000000 framestep.motors.backlash", b"\xff", None], b"\xff"), ids=repr
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
