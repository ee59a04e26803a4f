"""Boards one after another in one process: edges and bytes are as if each had its own."""

import subprocess
import time

import pytest
import serial

from framestep_emulator import Emulator, EmulatorError
from framestep_emulator.node import Pool
from framestep_tools import payloads as p
from framestep_tools.building import images
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.end_to_end.session import Session

RIG = {"motor_count": 6, "estop": "nc", "outputs": [{"pin": 26}], "remember_positions": True}


@pytest.fixture
def pool(monkeypatch):
    found = Pool()
    monkeypatch.setattr(Emulator, "pool", found)
    yield found
    found.close()


def session():
    """Return all that can be seen of a board that does some of everything: motors, DMX, an output,
    an input, a file, a REPL request, a soft reset, a watchdog reset, a pulled cable."""
    with EmulatedBoard(RIG) as board:
        emulator = board.emulator
        board.wire_switches()
        emulator.uart_start(0)
        seen = [emulator.cmd("digest"), emulator.trace_read().tobytes(), emulator.ns]
        found = Session(board, motors=6)
        found.speed(1, 10_000, 50_000)
        found.accept(p.Dmx(0, 1, [1, 2, 3]), p.GioOut(1), p.MotorMove(1, 500)).run(0.1)
        repl = emulator.repl()
        seen.append(
            repl.exec("import os, gc; print(os.listdir('/'), gc.mem_free(), os.urandom(4))")
        )
        repl.exec("open('/left', 'w').write('behind')")
        found.run(0.1)
        seen += [found.positions, emulator.pins(), emulator.cmd("adc", channel=1, value=99)]
        emulator.cmd("usb", plugged=False)
        emulator.advance(30)
        emulator.cmd("usb", plugged=True)
        emulator.wait_usb(ports=2, after=emulator.ns)
        repl.leave()
        repl.serial.write(b"\x04")
        emulator.advance(300)
        repl = emulator.repl()
        repl.start("import machine\nw = machine.WDT(timeout=100)\nwhile True: pass")
        emulator.wait_event("reset", 1000)
        emulator.advance(20)
        return [
            *seen, emulator.trace_read().tobytes(), emulator.events(), emulator.cycles(),
            emulator.uart_read(0), emulator.cmd("ports"), emulator.cmd("digest"),
        ]  # fmt: skip


@pytest.mark.repeats  # test_snapshots, and what every test of a board that was wound back sees
def test_a_board_that_is_wound_back_is_as_new(pool):
    """In a process that other boards used before, and once more in it without a boot."""
    Emulator.pool = None
    alone = session()
    Emulator.pool = pool
    with EmulatedBoard({"name": "other"}) as other:
        other.run_until(other.now_ns + 100_000_000)
    for _ in range(2):
        for mine, expected in zip(session(), alone, strict=True):
            assert mine == expected
        assert len(pool.idle) == 1, "one process for all"


def test_what_a_pool_takes_back(pool):
    """Processes with the arguments of their start, and no more than it may."""
    kinds = [["--chip", "B1"], [], ["--seed", "2"], ["--xip-miss", "0"]]
    for args in kinds:
        Emulator(images.emulator_ready(), args=args, boot=False).start().close()
    assert len(pool.idle) == pool.LARGEST
    with Emulator(images.emulator_ready(), args=kinds[-1], boot=False):
        assert len(pool.idle) == pool.LARGEST - 1
        with Emulator(images.emulator_ready(), args=kinds[-1], boot=False) as second:
            assert len(pool.idle) == pool.LARGEST - 1, "a second process for a second board"
            second.set_lockstep(False)
    assert len(pool.idle) == pool.LARGEST
    begun = [node.cmd("time")["ns"] for _, node in pool.idle]
    time.sleep(0.01)
    assert [node.cmd("time")["ns"] for _, node in pool.idle] == begun, "nothing runs unused"


def test_what_has_gone_wrong_stays_with_its_board(pool):
    """After a failure the pool uses no process again, neither a waiting one nor one in use."""
    Emulator(images.emulator_ready(), boot=False).start().close()
    with Emulator(images.emulator_ready(), args=["--seed", "2"], boot=False):
        pool.fail()
        assert not pool.idle
    assert not pool.idle
    with Emulator(images.emulator_ready(), boot=False):
        pass
    assert len(pool.idle) == 1, "a later one is"


def test_a_board_whose_answer_was_not_waited_for_is_not_used_again(pool, monkeypatch):
    with Emulator(images.emulator_ready(), boot=False) as emu, monkeypatch.context() as patched:
        patched.setattr(emu._node, "_ctl_file", patched)
        with pytest.raises(AttributeError):
            emu.advance(1)
    assert not pool.idle


def test_how_much_is_kept(pool):
    """The pool drops the state that was unused for longest."""
    with Emulator(images.emulator_ready(), boot=False) as emu:
        node = emu._node
        for number in range(17):
            node.keep(f"state {number}")
            if number == 15:
                node.rewind("state 0")
        assert node.rewind("state 0")
        assert not node.rewind("state 1")


def test_a_board_is_only_kept_as_it_has_started(pool):
    with Emulator(images.emulator_ready(), boot=False) as emu:
        emu.set_pin(3, 1)
        with pytest.raises(ValueError, match="something else has been done"):
            emu.once("late", lambda: None)


def test_a_trace_into_a_file_is_not_kept(pool, tmp_path):
    with Emulator(images.emulator_ready(), boot=False) as emu:
        emu.trace_start(file=tmp_path / "edges")
        with pytest.raises(EmulatorError, match="not with a trace into a file"):
            emu.cmd("keep", name="tracing")


def test_a_port_on_tcp(pool):
    """A process that is used again has it, too."""
    Emulator(images.emulator_ready(), boot=False).start().close()
    with (
        Emulator(images.emulator_ready()) as emu,
        emu.free_running(),
        emu.tcp_serial(timeout=100) as tcp,
    ):
        tcp.write(b"6 * 7\r")
        assert b"42" in tcp.read_until(b"42")


def test_clients_of_the_last_board_are_gone(pool):
    """A client that is still connected loses its connection."""
    with Emulator(images.emulator_ready(), lockstep=False, speed=1) as emu:
        left = emu.tcp_serial(timeout=100)
        left.write(b"6 * 7\r")
        assert b"42" in left.read_until(b"42")
    with Emulator(images.emulator_ready(), lockstep=False, speed=1) as emu:
        assert left.port == f"socket://127.0.0.1:{emu.tcp_ports[0]}", "the same process"
        with pytest.raises(serial.SerialException, match="disconnected"):
            while left.read():  # what was under way
                pass
        assert not emu.cmd("ports")["ports"][0]["open"]


def test_a_usb_device_that_is_being_enumerated_is_not_kept(pool):
    with Emulator(images.emulator_ready()) as emu:
        emu.cmd("usb", plugged=False)
        emu.cmd("usb", plugged=True)
        with pytest.raises(EmulatorError, match="a Generator cannot be kept"):
            emu.cmd("keep", name="half way")


def test_snapshots(paths):
    script = paths.root / "tools/framestep_emulator/board/test/snapshot.mjs"
    result = subprocess.run(["node", script], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
