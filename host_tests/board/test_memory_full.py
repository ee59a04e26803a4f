"""With not a byte of memory free, every request gets its answer, every stop works, and the REPL
says so."""

import pytest

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.building import images
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.board.test_end_to_end import assert_played, load, move
from host_tests.end_to_end.session import Session, assert_within

ESTOP, OUTPUT = 19, 22
VELOCITY, ACCELERATION = 10_000, 50_000
RIG = {"estop": "nc", "outputs": [{"pin": OUTPUT}], "dmx": False}
# Takes all memory in ever smaller pieces. While the output is on, it switches interrupts off, which
# is a fault if motors move. Once the output has been on, off and on again, it frees the memory.
FILL = f"""
import gc, time, machine
pin = machine.Pin({OUTPUT})
def fill():
    kept = None
    size = 8192
    while size >= 8:
        try:
            kept = [kept, bytearray(size)]
        except MemoryError:
            size //= 2
    return kept
def wait(level):
    while pin.value() != level:
        time.sleep_ms(2)
kept = irq = None  # now, as a new name needs memory
kept = fill()
print("full")
wait(1)
irq = machine.disable_irq()
{"time.sleep_us(900);" * 10}
machine.enable_irq(irq)
wait(0)
wait(1)
kept = None
gc.collect()
print("free")
"""
WORDS = (
    "framestep: the E-stop was pressed; the motors were ramped down",
    "framestep: the interrupt came too late, so pulses broke off; the motors were ramped down",
)


@pytest.fixture(scope="module")
def board():
    with EmulatedBoard(RIG) as board:
        board.wire_switches()
        yield board


@pytest.fixture(scope="module")
def full(board):
    """Yield a session while a program on the REPL has all memory."""
    session = Session(board, reply_s=0.1)
    session.positions_before = move(session, frames=40)
    session.stands = load(session, session.positions_before)
    session.accept(p.MotorStopAll())  # the run is uploaded and ends before it began
    session.run(0.3).forget().speed(8, VELOCITY, ACCELERATION)
    repl = session.repl = board.emulator.repl()
    repl.enter()
    repl.leave()  # nothing unasked is printed in raw mode
    repl.serial.write(b"\x05" + FILL.encode() + b"\x04")
    repl.expect(b"full\r\n")
    return session


def under_way(session, steps=20_000):
    session.accept(p.MotorMove(8, session.position(8) + steps)).forget().run(0.4)
    assert session.moving == [8]


def at_rest(session):
    session.wait_idle(5)
    assert_within(*session.steps(8), VELOCITY * 1.001, 4 * ACCELERATION * 1.05)
    assert not session.moving


def test_the_estop(full):
    emulator = full.board.emulator
    under_way(full)
    emulator.set_pin(ESTOP, 1)
    at_rest(full)
    assert [message for _, message in full.events(p.HardStop)] == [p.HardStop(0)]
    full.refuse(p.Ack.ERR_GENERAL, p.MotorMove(8, 0))
    assert full.ask(p.GetCondition()).bits & m.CONDITION_ESTOP
    emulator.set_pin(ESTOP, 0)
    full.run(0.3)
    under_way(full, -20_000)
    full.accept(p.MotorStopAll())
    at_rest(full)


def test_a_lost_host(full):
    under_way(full)
    full.leave()
    full.board.run_until(full.board.now_ns + 800_000_000)
    full.come_back().until(p.DeviceInfo)
    at_rest(full)


def test_a_run(full):
    positions = full.positions_before
    stands = load(full, positions)
    full.accept(p.RtGo()).until(p.RtEnd, 10).run(0.3)
    assert_played(full, stands, positions)


def test_a_fault_and_words_for_all_of_it(full):
    """Texts need no memory, either."""
    under_way(full)
    full.accept(p.GioOut(1)).run(0.4)
    assert [message for _, message in full.events(p.HardStop)] == [p.HardStop(100)]
    full.wait_idle(5).accept(p.GioOut(0)).run(0.1)
    full.accept(p.GioOut(1)).run(0.2)
    said = full.repl.expect(b"free\r\n", 60).decode()
    assert said.splitlines() == [*WORDS, "free"]
    assert full.repl.eval("__import__('framestep.boot').boot.runner.failure") is None


def test_what_is_released_is_free(emulator):
    """Even if something seems to point to it, as any word of machine code may."""
    repl = emulator(firmware=images.frozen(), files={"/main.py": b""}).repl()
    repl.exec(
        "import gc\n"
        "from framestep.hal.rp2.hal import release\n"
        "def free():\n    gc.collect()\n    return gc.mem_free()\n"
        "block = bytearray(4000)\n"
    )
    before = repl.eval("free()")
    repl.exec("release(block)")
    assert repl.eval("free()") - before >= 4000
    assert repl.eval("len(block)") == 0
