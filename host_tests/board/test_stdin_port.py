"""The protocol on the REPL's port (hal/ports/stdin_port.py) on the emulated board, against a host
that may misbehave."""

import random

import pytest

from framestep_emulator import Emulator, ReplError
from framestep_tools.building import images
from host_tests.board.modules import answered, frame, port_files, power_cycle, sealed, stop

STDIN_SETUP = """
import gc, time, micropython
from framestep.hal.ports.stdin_port import StdinPort
from ports_echo import Count, Echo, exchange, loop
port = StdinPort()
echo = Echo()
count = Count()
def run(turn):
    port.start()
    print('go')
    try:
        while True: turn(port)
    finally:
        port.stop()
"""


@pytest.fixture(scope="module")
def emu():
    with Emulator(images.emulator_ready(), files=port_files()) as emu:
        yield emu


@pytest.fixture
def stdin(emu):
    """Return (emulator, REPL, its port): the board, fresh from its start, with a StdinPort that is
    made but not started."""
    power_cycle(emu)
    repl = emu.repl()
    repl.exec(STDIN_SETUP)
    return emu, repl, repl.serial


@pytest.fixture(params=["rp2", "plain"])
def any_stdin(request, stdin):
    """Return the same; "plain" is for a chip whose USB is not known, and its reads have no time
    limit."""
    if request.param == "plain":
        stdin[1].exec(
            "import framestep.hal.ports.stdin_port as module\n"
            "module.chip = None\n"
            "port = StdinPort()"
        )
    return stdin


def enter_single_port(repl, turn="echo.turn"):
    repl.start(f"echo.longest_us = 0\nrun({turn})", until="go")


def leave_single_port(repl):
    """Leave the port as mpremote does."""
    repl.serial.write(b"\r\x03")
    with pytest.raises(ReplError, match="KeyboardInterrupt"):
        repl.finish(2)


def test_single_port_every_length(any_stdin):
    """Each frame gets its answer, also with Ctrl-C among its bytes; a Ctrl-C between frames returns
    to a working REPL."""
    _emu, repl, port = any_stdin
    enter_single_port(repl)
    late = [
        size
        for size in (*range(12, 1049, 29), *range(60, 70), *range(1042, 1049))
        if not answered(port, frame(size, size), ms=150)
    ]
    assert late == []
    assert answered(port, sealed(0x03030303, b"\x03" * 0x0303), ms=150)
    leave_single_port(repl)
    assert repl.eval("echo.damaged") == 0
    repl.start("print('on')\nwhile True: pass", until="on")
    stop(repl)


def test_single_port_throughput(stdin, capsys):
    emu, repl, port = stdin
    enter_single_port(repl, "lambda port: (port.poll(echo.reader), echo.reader.poll())")
    for n in range(40):
        port.write(frame(1036, n))
    begun = emu.ns
    port.flush()
    rate_in = 40 * 1036 / (emu.ns - begun) * 1e6
    leave_single_port(repl)
    enter_single_port(
        repl, "port.send(count) if count.left else port.poll(count)".join(("lambda port: ", ""))
    )
    leave_single_port(repl)
    repl.start(
        "count.left = 50000\nprint('go')\nwhile count.left: port.send(count)\nprint('end')",
        until="go",
    )
    begun = emu.ns
    port.timeout = 5
    assert len(port.read(50000)) == 50000
    rate_out = 50000 / (emu.ns - begun) * 1e6
    repl.finish()
    enter_single_port(repl)
    times = []
    for n in range(20):
        emu.advance(2 + n * 0.037)
        begun = emu.ns
        port.write(frame(12, n))
        emu.advance(20, until_rx=0)
        times.append((emu.ns - begun) / 1000)
        assert len(port.read(12)) == 12
    leave_single_port(repl)
    idle = repl.eval(
        "[(t := time.ticks_us()), [port.poll(count) for _ in range(200)], "
        "time.ticks_diff(time.ticks_us(), t)][2] / 200"
    )
    with capsys.disabled():
        print(
            f"\nsingle-port mode: in {rate_in:.0f} kB/s, out {rate_out:.0f} kB/s, "
            f"idle poll {idle:.0f} µs, "
            f"12-byte frame to answer {min(times):.0f} to {max(times):.0f} µs"
        )
    assert rate_in > 80
    assert rate_out > 80
    assert max(times) < 5000


def test_single_port_nothing_allocates(stdin):
    emu, repl, port = stdin
    repl.start(
        "port.start()\ntry: exchange(port, echo, count, 1000)\nfinally: port.stop()", until="go"
    )
    port.timeout = 1
    for n in range(1000):
        data = frame(12 + n % 200, n)
        if n % 50 == 49:  # stops in the middle
            port.write(data[: len(data) // 2])
            emu.advance(30)
            data = data[len(data) // 2 :]
        port.write(data)
        assert len(port.read(70)) == 70
    repl.finish()


def test_single_port_frame_that_stops(any_stdin):
    """A host that stops within a frame holds the main loop up once, for 20 ms at most; the rest may
    come at any time."""
    emu, repl, port = any_stdin
    data = frame(300, 1)
    for part in (1, 2, 5, 9, 10, 11, 73, 74, 75, 200, 299):
        enter_single_port(repl)
        port.write(data[:part])
        emu.advance(100)
        port.write(data[part : part + 1])
        emu.advance(40)
        port.write(data[part + 1 :])
        port.timeout = 0.06
        assert port.read(300) == data, part
        leave_single_port(repl)
        assert repl.eval("echo.longest_us") < 22_000
        assert repl.eval("echo.turns") > 100
        repl.exec("echo.turns = 0")
    assert repl.eval("echo.damaged") == 0


def test_single_port_frame_that_goes_on(stdin):
    """The host continues while the read of its frame ends: no byte is lost, and none is
    inserted."""
    emu, repl, port = stdin
    for gap_us in range(9900, 17500, 200):  # the host continues while the read ends
        data = sealed(gap_us, bytes(random.Random(gap_us).choices((0, 0, 0xFF, 0x44), k=100)))
        enter_single_port(repl)
        port.write(data[:20])
        emu.advance(gap_us / 1000)
        port.write(data[20:23])
        emu.advance(gap_us % 700 / 1000)
        port.write(data[23:])
        assert port.read(len(data)) == data, gap_us
        leave_single_port(repl)
    assert repl.eval("echo.damaged") == 0


def test_single_port_frame_given_up(any_stdin):
    """After the reader has dropped a frame, the next one is served and Ctrl-C counts again."""
    emu, repl, port = any_stdin
    enter_single_port(repl)
    port.write(frame(300, 1)[:100])
    emu.advance(50)
    port.write(b"\x03")
    emu.advance(50)
    assert port.in_waiting == 0, "Ctrl-C within a frame is data"
    port.write(frame(300, 1)[101:])
    emu.advance(50)
    assert port.in_waiting == 0, "it was not the byte that belonged there"
    assert answered(port, frame(200, 2), ms=60)
    leave_single_port(repl)
    repl.exec(
        "def turn(port):\n"
        "    echo.turn(port)\n"
        "    if time.ticks_diff(time.ticks_ms(), late) > 200: echo.reader.clear()"
    )
    repl.exec("late = time.ticks_ms()")
    enter_single_port(repl, "turn")
    port.write(frame(300, 1)[:100])
    emu.advance(300)
    assert answered(port, frame(12, 2), ms=60)
    leave_single_port(repl)


def test_single_port_ctrl_c_in_noise(any_stdin):
    """Among bytes that are not frames Ctrl-C is noise, until the line has been quiet."""
    emu, repl, port = any_stdin
    enter_single_port(repl)
    port.write(bytes(range(256)))
    emu.advance(30)
    port.write(b"x\x03")
    assert answered(port, frame(100, 1), ms=60)
    port.write(b"\x44\x03 D\x03 DF\x03")
    emu.advance(100)
    port.write(bytes(1048))
    emu.advance(200)
    leave_single_port(repl)
    assert repl.eval("6 * 7") == 42


def test_single_port_host_that_does_not_read(stdin):
    """Writing never holds the main loop up; `open` says that nobody reads, and bytes written
    meanwhile are dropped."""
    emu, repl, port = stdin
    repl.exec(
        "seen = []\n"
        "def turn(port):\n"
        "    echo.turn(port)\n"
        "    if not seen or seen[-1] != (port.open, port.openings): "
        "seen.append((port.open, port.openings))\n"
    )
    enter_single_port(repl, "turn")
    port.hold()
    for n in range(60):
        port.write(frame(150, n))
        emu.advance(20)
    port.hold(False)
    emu.advance(30)
    old = port.read_all()
    assert old
    assert old == b"".join(frame(150, n) for n in range(60))[: len(old)]
    assert answered(port, frame(100, 7), ms=60)
    leave_single_port(repl)
    assert repl.eval("seen") == [(True, 1), (False, 1), (True, 2)]
    assert repl.eval("echo.longest_us") < 20_000
