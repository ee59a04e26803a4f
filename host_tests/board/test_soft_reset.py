"""A soft reset, as mpremote makes one before each of its commands: the USB device stays, framestep
starts again."""

import json
import subprocess
import sys

import pytest

from framestep_emulator import edge_times
from framestep_tools.client.client import Client
from framestep_tools.payloads import Hi, MotorMove, MotorResetPosition, MotorSetSpeed, MotorStatus
from host_tests.board.conftest import on_both, on_pico

PATIENCE_S = 600
AGAIN_MS = 1800  # framestep is back after 1500
STEP, ENABLE = (2, 4), 18
RIG = {"name": "soft", "remember_positions": True}


def mpremote(path, *arguments):
    """Return what mpremote printed; without `resume`."""
    command = [sys.executable, "-m", "mpremote", "connect", path, *arguments]
    result = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    assert result.returncode == 0, f"mpremote {arguments}: {result.stdout} {result.stderr}"
    return result.stdout


def board(chip, **options):
    rig = json.dumps(chip.settings(RIG)).encode()
    return chip.emulator(files={"/rig.json": rig}, **options)


@pytest.fixture(scope="module")
def image(chip):
    """Yield one board for several tests."""
    with board(chip) as emu:
        emu.wait_usb(20_000, ports=2)
        yield emu


def answers(path):
    with Client.open(path, timeout_s=PATIENCE_S) as client:
        return client.request(Hi())


@on_pico
@pytest.mark.repeats
def test_mpremote_finds_its_port_and_framestep_is_there_again(chip, tmp_path):
    package = tmp_path / "hello"
    package.mkdir()
    (package / "hello.py").write_text("print('hello from a package')\n")
    (package / "package.json").write_text(
        json.dumps({"urls": [["hello.py", "hello.py"]], "version": "1"})
    )
    # no faster than a real board, so that it does not compute while mpremote starts
    with board(chip, lockstep=False, speed=1) as emu, emu.pty(0) as repl, emu.pty(1) as protocol:
        emu.wait_usb(ms=PATIENCE_S * 1000, ports=2)
        frames = answers(protocol).upload_frames
        emu.events(clear=True)
        assert mpremote(repl, "exec", "print(6 * 7)") == "42\n"
        assert answers(protocol).name == "soft"
        said = mpremote(
            repl, "mip", "install", str(package / "package.json"), "+", "exec", "import hello"
        )
        assert "hello from a package" in said
        info = answers(protocol)
        assert (info.name, info.motors) == ("soft", 8)
        assert info.upload_frames > 0.95 * frames, "memory is what it was"
        assert not [
            event for event in emu.events() if event["type"].startswith(("usb", "reset", "halt"))
        ]


@pytest.mark.repeats
def test_whoever_has_the_protocol_port_open(image):
    """Bytes sent before and during the reset belong to nobody; after it the host begins a new
    session."""
    repl, port = image.serial(0), image.serial(1)
    client = Client(port)
    for mode in (b"\x01", b"\x02"):  # raw, as by mpremote, and as by hand
        client.request(Hi())
        repl.write(b"\r\x03\r" + mode)
        image.advance(50)
        port.write(b"DF")  # a frame that is never finished
        image.advance(5)
        repl.write(b"\x04")
        image.advance(300)
        port.write(bytes(100) + b"DF\x10\x00")  # while nobody listens
        image.advance(AGAIN_MS)
        port.reset_input_buffer()
        assert client.request(Hi()).name == "soft"
        assert client.request(MotorStatus()).moving == []
    assert "soft reboot" in repl.read_all().decode()


def test_in_motion(image):
    """The motors stop at once, their drivers go off, and nothing expires later; the host hears what
    is lost."""
    emu = image
    client = Client(emu.serial(1))
    client.request(Hi())
    for motor in (1, 2):
        client.request(MotorSetSpeed(motor, 10_000, 50_000))
        client.request(MotorResetPosition(motor, 0))
    client.request(MotorMove(1, 100_000))
    client.request(MotorMove(2, -100_000))
    emu.advance(500)
    assert emu.pin(ENABLE) == 0
    repl = emu.serial(0)
    repl.write(b"\r\x03\r\x01")
    emu.advance(20)
    emu.trace_start([*STEP, ENABLE])
    assert client.request(MotorStatus()).moving == [1, 2]
    emu.advance(5)
    struck = emu.ns
    repl.write(b"\x04")
    emu.advance(AGAIN_MS)
    edges = emu.trace_stop()
    for pin in STEP:
        times = edge_times(edges, pin)
        assert len(times) > 20
        assert times[-1] < struck + 20_000_000, "no pulse after the soft reset"
    assert emu.pin(ENABLE) == 1
    assert all(emu.pin(pin) == 0 for pin in STEP)
    assert not [event for event in emu.events() if event["type"] in ("reset", "halt")]
    emu.serial(1).reset_input_buffer()
    client.request(Hi())
    assert client.request(MotorStatus()).moving == []


def test_lights_leave_memory_alone(chip):
    """DMX512 runs by DMA, which MicroPython does not stop: boot.py does, also if framestep does not
    start again."""
    with board(chip) as emu:
        emu.wait_usb(20_000, ports=2)
        repl = emu.repl()
        assert dma_running(repl, chip)
        repl.exec("open('/main.py', 'w').close()")
        repl.exec("import machine; machine.mem32[0x50100FC8] = 0")  # as if USB had not been active
        repl.enter()
        repl.serial.write(b"\x04")
        emu.advance(500)
        repl = emu.repl()
        assert repl.eval("'framestep.boot' in __import__('sys').modules") is False
        assert dma_running(repl, chip, enabled=0) == []


def dma_running(repl, chip, enabled=1):
    """Return the DMA channels that are busy or enabled."""
    control = f"__import__('machine').mem32[0x5000000C + 64 * i] & {chip.dma_busy | enabled}"
    return repl.eval(f"[i for i in range({chip.dma_channels}) if {control}]")


# boot.py that framestep 0.1.0 copied onto a stock MicroPython
COPIED = """
try:
    import framestep.soft_reset
except ImportError:
    pass
else:
    framestep.soft_reset.lower_pins()
    framestep.soft_reset.stop_dma()
    if framestep.soft_reset.usb_alive():
        import framestep.boot

        framestep.boot.start(True)
"""


@on_pico
@pytest.mark.parametrize(
    ("beside", "modes"),  # raw, as by mpremote, and as by hand
    [
        pytest.param(COPIED, b"\x01\x02", id="framestep's", marks=pytest.mark.repeats),
        pytest.param("mine = 6 * 7\n", b"\x02", id="user's"),
    ],
)
def test_an_image_beside_a_boot_py(chip, beside, modes):
    """It is a user's, or left from copied files: DMX512 and framestep continue after a soft
    reset."""
    files = {"/boot.py": beside, "/rig.json": json.dumps(chip.settings()).encode()}
    with chip.emulator(files=files) as emu:
        emu.wait_usb(20_000, ports=2)
        repl = emu.repl()
        for mode in modes:
            repl.enter()
            repl.serial.write(b"\r\x03\r" + bytes((mode,)))
            emu.advance(50)
            repl.serial.write(b"\x04")
            emu.advance(AGAIN_MS)
            repl = emu.repl()
            assert len(dma_running(repl, chip)) > 0, "DMX512 is dead"
            emu.uart_start(0)
            emu.advance(200)
            slots, _ = emu.uart_read(0)
            assert len(slots) >= 6 * 513
            if "mine" in beside:
                assert repl.eval("mine") == 42
            assert Client(emu.serial(1)).request(Hi()).motors == 8


@on_pico
@pytest.mark.repeats
def test_one_port_set_on_a_board_that_has_two(chip):
    """mpremote's raw REPL comes: framestep does not take it over from within boot.py. After Ctrl-D
    or a reset framestep has the one port."""
    with board(chip) as emu:
        emu.wait_usb(20_000, ports=2)
        repl = emu.repl()
        settings = '{"ports": 1, "name": "one"}'
        repl.exec(f"with open('/rig.json', 'w') as file: file.write({settings!r})")
        for _ in range(2):
            repl.serial.write(b"\r\x03\r\x01")
            emu.advance(50)
            repl.serial.read_all()
            repl.serial.write(b"\x04")
            emu.advance(AGAIN_MS)
            assert repl.serial.read_all().endswith(b"raw REPL; CTRL-B to exit\r\n>")
            assert repl.eval("6 * 7") == 42
            assert emu.pin(ENABLE) == 1, "the drivers are off"
        repl.leave()
        repl.serial.write(b"\x04")
        emu.advance(AGAIN_MS)
        repl.serial.reset_input_buffer()
        assert Client(repl.serial).request(Hi()).name == "one"


@on_both
def test_drivers_are_off_before_framestep_has_been_loaded(chip):
    """At power-on MicroPython itself takes most of this time."""
    with board(chip, boot=False) as emu:
        emu.advance(310)
        assert emu.pin(ENABLE) == 1


def test_a_boot_py_that_knows_nothing_of_framestep(chip):
    """At its start framestep stops DMA left from a soft reset, before it takes memory, even if
    BOOTSEL prevents the start."""
    with board(chip) as emu:
        emu.wait_usb(20_000, ports=2)
        repl = emu.repl()
        repl.exec("with open('/boot.py', 'w') as file: file.write('mine = 6 * 7\\n')")
        assert dma_running(repl, chip)
        repl.leave()
        emu.press_bootsel()
        repl.serial.write(b"\x04")
        emu.advance(3000)
        emu.press_bootsel(False)
        assert b"BOOTSEL is held" in repl.serial.read_all()
        repl = emu.repl()
        assert repl.eval("mine") == 42
        assert dma_running(repl, chip) == []


@on_pico
@pytest.mark.repeats
def test_a_host_that_closes_its_port_while_framestep_restarts(image):
    """Nobody hears it. The port counts as closed all the same, because nobody reads a packet: no
    motion stops for lack of a host, and the next host begins a new session."""
    repl, port = image.serial(0), image.serial(1)
    client = Client(port)
    client.request(Hi())
    repl.write(b"\r\x03\r\x02")
    image.advance(50)
    repl.write(b"\x04")
    image.advance(300)
    port.close()
    image.advance(2500)  # until a port without a reader counts as closed
    raw = image.repl()
    raw.exec("import framestep.repl, framestep.boot as boot")
    raw.exec("move(1, 100000)")
    image.advance(5000)
    assert raw.eval("boot.controller.reports.was_moving") is True
    assert raw.eval("boot.hal.port.open") is False
    openings = raw.eval("boot.hal.port.openings")
    port.open()
    assert Client(port).request(MotorStatus()).moving == [1]
    assert raw.eval("boot.hal.port.openings") == openings + 1
