"""The board as a whole: boot, resets, file system, time."""

import base64
import time

import numpy as np
import pytest

from framestep_emulator import TraceFile, device_file, edge_times
from framestep_emulator.errors import EmulatorError
from framestep_emulator.image import collect, make_image, read_image
from framestep_tools.building import images


def test_boots_to_repl(emulator):
    emu = emulator()
    emu.serial().read_until(b">>> ")
    out = emu.repl().exec(
        "import sys, machine; print(sys.implementation[1], sys.implementation[2], machine.freq())"
    )
    assert "1, 26, 1" in out
    assert "RP2040" in out
    assert "125000000" in out
    usb = [e for e in emu.events() if e["type"] == "usb-configured"]
    assert [e["ports"] for e in usb] == [1]


def test_resets(emulator):
    """machine.reset(), the watchdog, the bootloader, and what the board reports about each."""
    emu = emulator()

    def reset_cause_after(code):
        start = emu.ns
        emu.repl().start(code)
        emu.wait_event("reset", 1000)
        emu.wait_usb(after=start)
        return emu.repl().eval("__import__('machine').reset_cause()")

    assert emu.repl().eval("__import__('machine').reset_cause()") == 1, "power-on"
    assert reset_cause_after("import machine; machine.reset()") == 3
    begun = emu.ns
    assert (
        reset_cause_after(
            "import machine\nw = machine.WDT(timeout=200)\nw.feed()\nwhile True: pass"
        )
        == 3
    )
    last = [e for e in emu.events() if e["type"] == "reset"][-1]
    assert 200 < (last["t"] - begun) / 1e6 < 260, "the watchdog's time"
    emu.repl().start("import machine; machine.bootloader()")
    emu.advance(100)
    assert "bootsel" in (emu.halted or "")
    emu.reset()
    assert emu.repl().eval("2 + 2") == 4, "after a power cycle"


BAD_READ = """
import uctypes
@micropython.viper
def read(at: ptr32) -> int:
    n = 9
    x = at[9]
    n += n
    n += n
    return x + n
word = uctypes.addressof(bytearray(64))
for _ in range(RUNS):
    read(word)
read(0x30000000)
"""


@pytest.mark.parametrize("runs", [0, 7_000], ids=["new code", "code that has run often"])
@pytest.mark.parametrize("board", [None, "pico2"], ids=["RP2040", "RP2350"])
def test_a_fault_is_told_with_the_address_of_its_instruction(board, runs, emulator):
    emu = emulator(firmware=board and images.frozen(board))
    with pytest.raises(EmulatorError):
        emu.repl().exec(BAD_READ.replace("RUNS", str(runs)))
    assert "fault: read of 30000024 (pc " in emu.halted.lower().replace("hardfault", "fault")
    at = int(emu.halted.split("(pc ")[1].split(",")[0], 16)
    instruction = base64.b64decode(emu.cmd("peek", address=at, length=2)["data"])
    assert int.from_bytes(instruction, "little") & 0xFFC0 == 0x6A40  # LDR r, [r, #0x24]


def test_files_from_directories(emulator, tmp_path):
    (tmp_path / "lib" / "deep" / "__pycache__").mkdir(parents=True)
    (tmp_path / "lib" / "deep" / "module.py").write_text("answer = 42\n")
    (tmp_path / "lib" / "deep" / "__pycache__" / "module.pyc").write_text("")
    (tmp_path / "one.txt").write_bytes(b"\x00one")
    put = {tmp_path / "lib": "/lib", tmp_path / "one.txt": "/data/"}
    assert set(collect(put)) == {"/lib/deep/module.py", "/data/one.txt"}
    emu = emulator(
        files={"/main.py": "import deep.module\nprint('main', deep.module.answer)"}, put=put
    )
    assert "main 42" in emu.repl().serial.read_until(b">>> ").decode()
    repl = emu.repl()
    assert repl.eval("open('/data/one.txt', 'rb').read()") == b"\x00one"
    # what the board writes can be read back from its flash
    repl.exec("with open('/data/two.bin', 'wb') as f: f.write(bytes(range(256)) * 40)")
    emu.cmd("flash_dump", file=str(tmp_path / "flash"), fs=True)
    assert read_image((tmp_path / "flash").read_bytes())["/data/two.bin"] == bytes(range(256)) * 40


def test_image_too_big():
    with pytest.raises(ValueError, match=r"/big \(2000000 bytes\) does not fit"):
        make_image({"/big": bytes(2_000_000)}, images.micropython("rp2"))


def test_lockstep_is_deterministic(emulator):
    """Two runs with the same inputs give the same edges and bytes at the same nanosecond."""

    def once():
        emu = emulator()
        repl = emu.repl()
        repl.exec(device_file("pulses.py"))
        emu.trace_start(range(16))
        out = repl.exec(
            "import os, random, time\n"
            "for k in range(20):\n"
            "    sms[k & 7].put(((10 + k) << 12) | (9 << 1) | (k & 1))\n"
            "print(os.urandom(4), random.random(), time.ticks_us())\n"
        )
        emu.advance(7.3)
        edges = emu.trace_stop()
        assert len(edges) > 300
        return out, edges.tobytes(), emu.ns

    assert once() == once()


TOGGLE = (
    b"import machine\rled = machine.Pin(25, machine.Pin.OUT)\r"
    b"t = machine.Timer(freq=%d, callback=lambda t: led.toggle())\r"
)


def test_free_running_keeps_pace(emulator):
    emu = emulator(lockstep=False, speed=1)
    emu.wait_usb()
    emu.serial().write(TOGGLE % 50)
    emu.advance(200)
    for _ in range(100):
        emu.trace_start([25])
        real, ns = time.monotonic(), emu.ns
        time.sleep(1.5)
        passed, real = emu.ns - ns, time.monotonic() - real
        edges = emu.trace_stop()
        assert passed / 1e9 / real < 1.05, "never faster"
        if passed / 1e9 / real > 0.5:
            break
    else:
        pytest.fail("slower, and not only while the computer is busy with other things")
    apart = np.diff(edge_times(edges, 25)[1:])
    assert len(apart) > 20
    assert np.abs(apart - 20e6).max() < 4e6, "an edge each 20 ms of virtual time"


def test_trace_file_can_be_followed(emulator, tmp_path):
    """Every event is in the file within 50 ms of real time, and none gets lost."""
    emu = emulator(lockstep=False, speed=1)
    emu.wait_usb()
    emu.trace_start([25], file=tmp_path / "trace")
    emu.serial().write(TOGGLE % 200)
    with TraceFile(tmp_path / "trace") as trace:
        parts, late = [], []
        # the first part begins with the level before; a busy computer may be late now and then
        while sum(map(len, parts)) < 100 or np.median(late[-9:]) >= 50:
            time.sleep(0.005)
            part = trace.read()
            if len(part):
                late.append((emu.ns - part["t"][0]) / 1e6)
                parts.append(part)
        emu.trace_stop()
        parts.append(trace.read())
    edges = np.concatenate(parts)
    assert len(edges) >= 100
    assert (np.diff(edge_times(edges, 25)[2:]) < 10e6).all(), "an edge each 5 ms"
    assert (np.diff(edges["level"][1:].astype(int)) != 0).all(), "levels alternate"
