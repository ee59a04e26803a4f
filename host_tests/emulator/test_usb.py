"""A second USB serial port, made with machine.USBDevice."""

import subprocess

import pytest

from framestep_emulator import device_file


def test_second_usb_port(emulator):
    """A CDC made with machine.USBDevice appears next to the builtin one and disappears with a soft
    reset."""
    emu = emulator(files={"/cdc2.py": device_file("cdc2.py")})
    repl = emu.repl()
    repl.exec(
        "import cdc2\n"
        "sizes = []\n"
        "port = cdc2.CDC2(lambda p, n: sizes.append((n, bytes(p.rx[:4]))))\n"
    )
    start = emu.ns
    repl.serial.write(b"port.start()\x04")
    emu.wait_usb(after=start, ports=2)
    emu.advance(20)
    repl = emu.repl()
    second = emu.serial(1)
    second.write(b"abcd" * 259)
    second.write(b"xy")
    emu.advance(20)
    assert repl.eval("sizes") == [(1036, b"abcd"), (2, b"xycd")]
    repl.exec("port.write(b'answer ' * 30)")
    assert second.read(210) == b"answer " * 30, "device to host"
    second.hold()
    repl.exec("port.write(b'later')")
    emu.advance(20)
    assert second.in_waiting == 0, "a program that does not read"
    second.hold(False)
    assert second.read(5) == b"later"
    second.close()
    with emu.free_running(), emu.tcp_serial(1, timeout=100) as tcp:
        tcp.write(b"over TCP")
        repl.exec("import time; time.sleep_ms(20); port.write(port.rx[:8])")
        assert tcp.read(8) == b"over TCP", "the second port on TCP"
    start = emu.ns
    repl.leave()
    repl.serial.write(b"\x04")
    emu.wait_usb(after=start, ports=1)
    emu.advance(50)
    assert emu.repl().eval("1 + 1") == 2, "REPL after it"


def test_what_a_host_sees_of_it(emulator):
    """Names and serial number; a full packet is handed on when a read is full or after a short
    packet."""
    emu = emulator(files={"/cdc2.py": device_file("cdc2.py")})
    repl = emu.repl()
    event = next(e for e in emu.events() if e["type"] == "usb-configured")
    assert event["names"] == ["Board CDC"]
    assert event["product"] == "Board in FS mode"
    assert event["serial"] == repl.eval("__import__('machine').unique_id().hex()")
    repl.exec("import cdc2\nport = cdc2.CDC2(lambda p, n: None)")
    start = emu.ns
    repl.serial.write(b"port.start()\x04")
    emu.wait_usb(after=start, ports=2)
    emu.advance(20)
    repl = emu.repl()
    second = emu.serial(1)
    for data, seen in (
        (bytes(64), 0), (b"", 64), (bytes(64), 0), (bytes(64), 128), (bytes(63), 63),
    ):  # fmt: skip
        repl.exec(f"port.write({data!r})")
        emu.advance(5)
        assert len(second.read_all()) == seen


def test_double_buffered_endpoints(paths):
    """The controller's side of what newer drivers do: alternating buffers, and a buffer that the
    driver takes back."""
    script = paths.root / "tools/framestep_emulator/board/test/usb.mjs"
    result = subprocess.run(["node", script], capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    assert int(result.stdout.split()[0]) >= 8


@pytest.mark.parametrize("script", ["usbhost", "timer"])
def test_what_other_firmware_needs(paths, script):
    """Answers between received packets, control packets of 16 bytes; the timer at another rate."""
    script = paths.root / f"tools/framestep_emulator/board/test/{script}.mjs"
    result = subprocess.run(["node", script], capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr


def test_waiting_takes_the_boards_time(emulator):
    """A read ends at its timeout, even at a short one, and a client counts in the board's time."""
    emu = emulator()
    port = emu.serial()
    emu.advance(100)
    port.reset_input_buffer()
    for timeout in (0.25, 1 / 3, 1e-6 / 7, 0):
        begun, port.timeout = port.clock(), timeout
        assert port.read(1) == b""
        assert abs(port.clock() - begun - timeout) < 1e-6
