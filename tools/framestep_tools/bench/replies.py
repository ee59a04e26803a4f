"""How long answers take in each kind of pass: `make profile ARGS=answers`.

Each question comes at a random moment of a state. Just before it the board is asked on its REPL
what it does, and put back to before that, so what it is asked there costs the answers nothing.
"""

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.table import Table

from framestep.moves import operation_runner as runner
from framestep.moves.upload.store import LOADING
from framestep.protocol.messages import MOTOR_ENABLED

from ..client.client import upload_requests
from ..errors import ToolError
from ..payloads import (
    GioIn,
    Home,
    MotorConfigure,
    MotorJog,
    MotorMove,
    MotorSetSpeed,
    MotorStatus,
    MotorStopAll,
    Request,
    RtEnd,
    RtGo,
    RtRunMove,
    VirtConfig,
)
from ..simulator.boards import EmulatedBoard
from .measure import _ON_LINE, Asker, _take_arm, rig_of
from .moves import (
    CLOCK_MHZ,
    FPS,
    MOTORS,
    RAMP,
    READY_S,
    STEADY_RATES,
    WINDOW,
    mixed_move,
    steady_move,
)
from .session import Session
from .stops import begin_jog_all, begin_shot

BOARDS = (("pico", CLOCK_MHZ), ("pico", 200), ("pico2", 150))  # and their clocks in MHz
COUNT = 120  # questions in a state, a third of which wait for a pass
BINS = (0.25, 0.5, 1, 1.5, 2, 3)  # ms
_PAUSE_S = (0.001, 0.02)  # before a question
_COMES_S = 10  # until a state is in effect
_APART_S = 1.1  # two STOP_ALL within a second are a hard stop
_RATE = 20_000  # steps/s
_FASTEST = max(STEADY_RATES) * 11 // 10
_FAR = 2**31 - 1
_AWAY = 30_000  # steps to the start of a run: 1.6 s
_ROLL_MS = 1000  # then motors are 10 000 steps beyond the last frame
_LOOP = 2
_JOGS_AGAIN_S = 0.1
_UPLOAD_FRAMES = 10_000
_SWITCH = 22  # a pin
_HOME = {"limit": 1, "travel": 60_000, "speed": 3000, "slow_speed": 500, "back_off": 150}
_LOOK = """
from framestep.boot import controller as c
def look():
    o = c.operations
    print(type(o.operation).__name__, o.state, int(o.starts_by_itself), c.axes.moving_bits(),
        c.interlock.jogging, c.interlock.homing, c.virtuals.owned, c.moves.store.state)
"""


@dataclass(frozen=True)
class Look:
    """What a board does: its operation, and bits of the motors that move, jog, are homed, or move
    along a line."""

    unread: int  # bytes that wait for the board to read them
    operation: str
    state: int  # of OperationRunner
    laps: int  # 1: the next one begins by itself
    moving: int
    jogging: int
    homing: int
    on_line: int
    upload: int  # state of UploadStore

    @property
    def runs(self) -> bool:
        """Whether an operation has begun."""
        return self.state in (runner.STARTING, runner.RUNNING, runner.GONE)


class _Looker:
    """Looks at a board without a trace."""

    def __init__(self, session: Session):
        self._board = session.board
        self._repl = session.board.emulator.repl()
        self._repl.exec(_LOOK)
        session.client.pump(READY_S)  # that held up passes

    def __call__(self) -> Look:
        unread = self._board.protocol.pending
        with self._board.undone():
            words = self._repl.exec("look()").split()
        operation, *numbers = words
        return Look(unread, operation, *map(int, numbers))


class _Waiting(Asker):
    """Asks what only a pass answers."""

    KINDS = (GioIn,)


@dataclass(frozen=True)
class State:
    """A state: what begins it, whether it is in effect, and what goes on meanwhile."""

    name: str
    begin: Callable[[Session], Any]
    holds: Callable[[Look], bool]
    meanwhile: Callable[[Session], None] = lambda session: None  # before each question
    pause_s: tuple[float, float] = _PAUSE_S


def _all(session: Session, kind: Callable[..., Request[Any]], *words: int) -> None:
    """Request something for all motors: kind(motor, *words)."""
    for motor in range(1, MOTORS + 1):
        session.client.request(kind(motor, *words))


def _speeds(session: Session) -> None:
    _all(session, MotorSetSpeed, _RATE * 11 // 10, RAMP)


class _Upload:
    """A host that always has sections on their way."""

    def __init__(self) -> None:
        self._sent: deque[int] = deque()
        self._left: Iterator[Request[Any]] = iter(())
        self._random = np.random.default_rng()

    def begin(self, session: Session) -> None:
        positions = {m: np.arange(_UPLOAD_FRAMES) * m for m in range(1, MOTORS + 1)}
        self._left = iter(list(upload_requests(1, _UPLOAD_FRAMES, positions))[:-1])
        self._sent.clear()
        self._random = np.random.default_rng(1)
        session.client.request(next(self._left))
        self.go_on(session)

    def go_on(self, session: Session) -> None:
        """Send some sections, so that the last ones of them are on their way."""
        client = session.client
        while self._sent:  # answered before the last question
            client.answer_to(self._sent.popleft())
        for _ in range(self._random.integers(WINDOW, 2 * WINDOW)):
            if len(self._sent) == WINDOW:
                client.answer_to(self._sent.popleft())
            if section := next(self._left, None):
                self._sent.append(client.send(section))


def _run(session: Session, away: int = 0, flags: int = 0) -> None:
    """Upload a run that begins `away` steps from where the motors are, and prepare it."""
    _speeds(session)
    stands = session.positions
    path = {m: stands[m] + away + steps for m, steps in steady_move(_RATE, MOTORS).items()}
    frames = len(path[1])
    session.client.upload_move(1, frames, path, WINDOW)
    session.client.request(RtRunMove(FPS * 1000, 1, frames, _ROLL_MS, _ROLL_MS, flags=flags))


def _go(session: Session, flags: int = 0) -> None:
    _run(session, flags=flags)
    session.client.wait_idle()
    session.client.pump(READY_S)
    session.client.request(RtGo())


def _after_run(session: Session) -> None:
    _go(session)
    session.client.wait_event(RtEnd, _COMES_S)


def _mixed(fps: int) -> Callable[[Session], None]:
    def begin(session: Session) -> None:
        session.prepare(mixed_move(2.4, fps), _FASTEST, fps)
        session.client.request(RtGo())

    return begin


def _shot(session: Session) -> None:
    session.client.request(begin_shot(session, max(STEADY_RATES)))
    session.client.wait_idle()
    session.client.pump(READY_S)
    session.client.request(RtGo())


def _jog_all(session: Session) -> None:
    session.client.request(begin_jog_all(session, max(STEADY_RATES)))


def _move(session: Session) -> None:
    _speeds(session)
    for motor, stands in session.positions.items():
        session.client.request(MotorMove(motor, stands + 5 * _RATE * (-1) ** motor))


class _Jogs:
    """A host that repeats its jogs."""

    def __init__(self) -> None:
        self._sent_s = 0.0

    def begin(self, session: Session) -> None:
        _speeds(session)
        self._sent_s = -_JOGS_AGAIN_S  # also if another board, with another clock, was asked before
        self.go_on(session)

    def go_on(self, session: Session) -> None:
        if session.client.clock() - self._sent_s > _JOGS_AGAIN_S:
            self._sent_s = session.client.clock()
            _all(session, MotorJog, 10_000, _FAR)


def _on_line(index: int) -> Callable[[Session], None]:
    def begin(session: Session) -> None:
        _take_arm(session)
        session.client.request(_ON_LINE[index][0])

    return begin


_upload, _jogs = _Upload(), _Jogs()
STATES = (
    State("at rest", lambda _: None, lambda now: not now.moving and not now.state),
    State(
        "upload",
        _upload.begin,
        lambda now: now.upload == LOADING and now.unread > 0,
        _upload.go_on,
        (0, 0.002),
    ),
    State(
        "positioning",
        lambda session: _run(session, _AWAY),
        lambda now: now.state == runner.POSITIONING and not now.laps,
    ),
    State("ready", _run, lambda now: now.state == runner.READY and not now.laps),
    *(
        State(
            f"run at {fps} frames/s",
            _mixed(fps),
            lambda now: now.runs and now.operation == "RunMove",
        )
        for fps in (25, 60)
    ),
    State(
        "to the end frame",
        _after_run,
        lambda now: now.state in (runner.LEAVING, runner.IDLE) and now.moving > 0,
    ),
    State(
        "to the next lap",
        lambda session: _go(session, _LOOP),
        lambda now: now.state == runner.POSITIONING and now.laps > 0,
    ),
    State("SHOOT_FRAME", _shot, lambda now: now.runs and now.operation == "ShootFrame"),
    State("JOG_ALL", _jog_all, lambda now: now.state > 0 and now.operation == "JogAll"),
    State(
        "single moves",
        _move,
        lambda now: now.moving == 2**MOTORS - 1 and not now.jogging and not now.state,
    ),
    State("jogs", _jogs.begin, lambda now: now.jogging == 2**MOTORS - 1, _jogs.go_on),
    State("virtual move", _on_line(0), lambda now: now.on_line > 0),
    State("jog on a line", _on_line(1), lambda now: now.on_line > 0),
    State(
        "homing",
        lambda session: session.client.request(Home()),
        lambda now: now.homing > 0,
    ),
)


def _come(session: Session, state: State, look: _Looker) -> None:
    """Begin a state, and wait until it is in effect. Raises ToolError if it does not come."""
    client = session.client
    client.events.clear()
    state.begin(session)
    begun = client.clock()
    while not state.holds(now := look()):
        if client.clock() - begun > _COMES_S:
            raise ToolError(f"no answers were timed in {state.name}: the board is at {now}")
        client.pump(0.02)


def _leave(session: Session) -> None:
    client = session.client
    if not client.request(MotorStatus()).idle:
        client.request(MotorStopAll())
        client.wait_idle()
        client.pump(_APART_S)
    _all(session, MotorConfigure, MOTOR_ENABLED)  # as before a SHOOT_FRAME
    client.request(VirtConfig.unpack(b"\0"))


def delays(
    session: Session, state: State, look: _Looker, count: int = COUNT
) -> tuple[list[float], list[float]]:
    """Return the delays of answers in a state, in ms: of questions that are answered at once, and
    of those that wait for a pass. Raises ToolError if the state does not come."""
    client = session.client
    random = np.random.default_rng(1)
    at_once, waiting = Asker(client), _Waiting(client)
    asked = 0
    while asked < count:
        _come(session, state, look)
        while asked < count:
            state.meanwhile(session)
            client.pump(random.uniform(*state.pause_s))
            if not state.holds(look()):
                break
            (waiting if asked % 3 == 2 else at_once).ask()
            asked += 1
        _leave(session)
    return at_once.ms, waiting.ms


def measured(
    board: str,
    mhz: int,
    args: Sequence[str] = (),
    states: Sequence[State] = STATES,
    count: int = COUNT,
) -> dict[str, tuple[list[float], list[float]]]:
    """Return delays() under the states' names, of a board at a clock with eight motors.

    args: of the emulator.
    """
    rig = rig_of(mhz, board)
    first, *others = rig["motors"]
    rig |= {"motors": [first | {"home": _HOME}, *others], "limits": [{"low": _SWITCH}]}
    with EmulatedBoard(rig, trace=False, board=board, args=args) as emulated:
        emulated.wire_switches()
        session = Session(emulated)
        look = _Looker(session)
        return {state.name: delays(session, state, look, count) for state in states}


def histogram(title: str, found: Mapping[str, Sequence[float]]) -> Table:
    """Return a table of delays (ms) in each state: how many of them are in each bin."""
    table = Table(title=title, title_justify="left")
    heads = [*(f"≤ {end:g}" for end in BINS), f"> {BINS[-1]}", "count", "median", "worst"]
    table.add_column("state", no_wrap=True)
    for head in heads:
        table.add_column(head, justify="right", no_wrap=True)
    for name, ms in found.items():
        counts = np.bincount(np.searchsorted(BINS, ms), minlength=len(BINS) + 1)
        cells = [str(number or "") for number in counts]
        table.add_row(name, *cells, str(len(ms)), f"{np.median(ms):.2f}", f"{max(ms):.2f}")
    return table


def tables(board: str, mhz: int, args: Sequence[str] = ()) -> tuple[Table, Table]:
    """Return tables of the answers of a board at a clock (MHz): of those at once, and of those that
    wait for a pass."""
    found = measured(board, mhz, args)
    kinds = ("questions answered at once", "a request that waits for a pass")
    first, second = (
        histogram(f"{board}, {mhz} MHz: {kind}, ms", {name: ms[i] for name, ms in found.items()})
        for i, kind in enumerate(kinds)
    )
    return first, second
