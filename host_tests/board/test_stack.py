"""However much of MicroPython's stack a program on the REPL uses: the controller continues, and
nothing is written below the stack, where the heap ends.
"""

import pytest

from framestep.hal import DEEPEST, REPL_STACK, STACK
from framestep_tools import payloads as p
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.board.test_end_to_end import assert_played, load, move
from host_tests.end_to_end.session import Session, assert_within

VELOCITY, ACCELERATION = 10_000, 50_000
STEPS = 12_000
BOTTOM, TOP = 0x2004_0000, 0x2004_2000
SPARE = 200  # bytes of the stack that nothing reaches
ESTOP = 19
# Calls itself until the stack is full, repeatedly
RUNAWAY = """
def runaway(n):
    runaway(n + 1)
for _ in range(400):
    try:
        runaway(0)
    except RuntimeError:
        pass
"""
LOW = f"""
import micropython
from machine import mem32
def fill():
    for at in range({BOTTOM}, {TOP} - 3500, 4):
        mem32[at] = 0x5A5A1234
def low():
    at = {BOTTOM}
    while mem32[at] == 0x5A5A1234:
        at += 4
    return {TOP} - at
fill()
"""


@pytest.fixture(scope="module")
def session():
    with EmulatedBoard({"dmx": False, "estop": "nc"}) as board:
        board.wire_switches()
        session = Session(board, reply_s=0.1)
        session.repl = board.emulator.repl()
        yield session


@pytest.mark.parametrize(
    ("at_once", "trace"),
    [
        (False, ""),
        (True, ""),
        pytest.param(True, "import framestep.repl\ntrace()", marks=pytest.mark.repeats),
    ],
)
def test_what_the_largest_pass_takes(session, at_once, trace):
    """From the prompt on, including everything on top of it; also with questions answered at
    once."""
    repl = session.repl
    if trace:
        repl.exec(trace)
    prompt = repl.eval("__import__('micropython').stack_use()")
    repl.exec(LOW)
    if not at_once:
        repl.exec("import framestep.boot\nframestep.boot.hal.port.answer = False")
    positions = move(session, frames=40)
    stands = load(session, positions)
    session.accept(p.RtGo())
    assert session.client.wait_event(p.RtEnd, 10)
    session.run(0.1)
    assert_played(session, stands, positions)
    session.accept(p.MotorMove(1, 2000), p.MotorMove(2, -2000)).run(0.1)
    session.accept(p.MotorStopAll(), p.MotorStopAll()).wait_idle()
    if trace:
        assert "RT_GO" in repl.exec("trace()\ntrace(0)")
    low = repl.eval("low()")
    repl.exec("import framestep.boot as b\nb.hal.port.answer = b.controller.answer")
    # interrupts, which check no limit, may go beyond MicroPython's
    assert 3500 < low <= prompt + TOP - BOTTOM - SPARE - DEEPEST


def test_a_runaway_recursion_while_a_motor_moves(session):
    session.speed(8, VELOCITY, ACCELERATION)
    session.repl.exec(LOW)
    session.forget()
    begin = session.position(8)
    session.accept(p.MotorMove(8, begin + STEPS))
    session.repl.start(RUNAWAY)
    session.wait_idle(20)
    session.repl.finish()
    assert session.events(p.HardStop) == []
    assert session.made(8) == session.position(8) - begin == STEPS
    assert_within(*session.steps(8), VELOCITY * 1.001, ACCELERATION * 1.05)
    assert session.repl.eval("__import__('framestep.boot').boot.runner.alive") is True
    assert REPL_STACK < session.repl.eval("low()") <= TOP - BOTTOM - SPARE


@pytest.mark.repeats
def test_the_estop_acts_in_a_runaway_recursion(session):
    """Pressed at any depth: its interrupt runs to its end, although MicroPython's limit would end
    it."""
    session.speed(8, VELOCITY, ACCELERATION)
    session.repl.exec(LOW)
    for turn in range(6):
        session.forget()
        begin = session.position(8)
        session.accept(p.MotorMove(8, begin + STEPS))
        session.repl.start(RUNAWAY)
        session.run(0.15 + turn * 0.0913)  # within a second, so that every timer expires sometimes
        session.board.emulator.set_pin(ESTOP, 1)
        session.wait_idle(20)
        session.board.emulator.set_pin(ESTOP, 0)
        session.repl.finish()
        session.run(0.1)
        assert [stop.reason for _, stop in session.events(p.HardStop)] == [0]
        assert session.made(8) == session.position(8) - begin < STEPS
    assert session.repl.eval("low()") <= TOP - BOTTOM - SPARE


# What a program on the REPL finds: the limit comes after the stack's top, and is one of the two.
FIND = f"""
from array import array
import framestep.boot
from framestep.hal.rp2.stack import WholeStack
from machine import mem32
[limit] = [
    at + 4
    for at in range(0x20000000, 0x20010000, 4)
    if mem32[at] == {TOP} and mem32[at + 4] in ({STACK}, {REPL_STACK})
]
seen = []
def work(x):
    seen.append(mem32[limit])
    inside[0] += 1
    raise ValueError
inside = array("i", [0])
call = WholeStack(limit, work, inside).callback
"""
RAISED = """
try:
    call(0)
except ValueError:
    seen.append(mem32[limit])
"""
# makes passes report, and does not end
TOLD = """
__import__("time").sleep_ms(300)
try:
    for i in range(40):
        framestep.boot.runner.report_driver(i, "a line that is long enough to fill a port's buffer")
    while True:
        pass
except KeyboardInterrupt:
    struck = True
"""


def test_an_exception_leaves_the_limit_as_it_was(session):
    session.repl.exec(FIND)
    assert session.repl.eval("mem32[limit]") == REPL_STACK
    session.repl.exec(RAISED)
    assert session.repl.eval("seen + list(inside)") == [STACK, REPL_STACK, 0]


def test_a_ctrl_c_while_something_is_reported(session):
    """The REPL's port is full and makes passes wait: the report is cut short, the Ctrl-C goes to
    the program, the passes continue, and programs have no more stack than before."""
    repl = session.repl
    repl.exec(FIND)
    repl.start(TOLD)
    repl.serial.hold()
    session.board.emulator.advance(500)
    repl.serial.write(b"\x03")
    session.board.emulator.advance(300)
    repl.serial.hold(False)
    repl.finish()
    assert repl.eval("struck") is True
    assert repl.eval("mem32[limit]") == REPL_STACK
    assert repl.eval("framestep.boot.runner.alive") is True
    session.run(0.1)  # the client's clock was stopped
    assert session.client.request(p.MotorStatus()).moving == []


@pytest.mark.repeats
def test_the_limit_after_a_soft_reset():
    """MicroPython sets it only at power-on: framestep's second start finds its own."""
    with EmulatedBoard({"dmx": False}) as board:
        repl = board.emulator.repl()
        repl.enter()
        repl.serial.write(b"\x04")
        board.emulator.advance(6000)
        repl = board.emulator.repl()
        repl.exec(FIND + RAISED)
        assert repl.eval("seen + [mem32[limit]]") == [STACK, REPL_STACK, REPL_STACK]
