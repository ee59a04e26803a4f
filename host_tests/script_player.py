"""Plays session scripts (script.py) with the controller on the host HAL, in virtual time."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

from framestep.hal.host import BOARD, TICK_DELAY_NS, UPLOAD_BYTES, HostFlash
from framestep.hal.host_board import HostBoard
from framestep.rig import RigError
from framestep_tools.building.board_files import board_data
from framestep_tools.simulator import driver_chips
from framestep_tools.simulator.driver_chips import Chips

from .observers import Tolerances
from .script import Script, parse

_MS = 1_000_000


class Player:
    """A controller and its millisecond. It calls `on_edge(time_ns, signal, value)` for every edge.

    sent: [(ms, bytes)] that the host has received, in the order of sending.
    """

    links = True  # the port may close at any time, and the link may have faults
    pauses = True  # the main loop may be away
    within = Tolerances()
    ticks = None
    repl = working = False

    def __init__(self, script: Script, on_edge: Callable[[int, str, int], None] | None = None):
        self.script = script
        self.ms = 0
        self.sent: list[tuple[int, bytes]] = []
        self.full = False
        self.recorder = None  # the board's Recorder (recording.py), if there is one
        self._held = 0  # milliseconds left without a pass
        self._off = 0  # milliseconds left without interrupts
        self._missed = 0  # ticks to be made up for
        self._next = 0
        self.board = board = self._make(script)
        board.on_edge = on_edge
        port = board.hal.port
        self._send = port.send
        port.send = self._offer

    @property
    def heard_ms(self) -> float:
        """By when the host has heard what was sent in the last millisecond."""
        return self.ms

    @staticmethod
    def _make(script: Script) -> HostBoard:
        data = BOARD if script.board == "host" else board_data(script.board)
        flash: HostFlash | bool = False
        if script.flash is not None:
            flash = HostFlash()
            for block, content in script.flash.items():
                flash.content[block][: len(content)] = content
        memory = UPLOAD_BYTES if script.memory is None else script.memory

        def wire(hal):
            chips = driver_chips.of(hal.board)
            return Chips(chips, lambda: hal.now_ns, apart="pins" in hal.board.get("drivers", {}))

        def start(rig, broken=False):
            return HostBoard(
                rig, script.motors, data, broken, wire=wire, flash=flash, upload_bytes=memory
            )

        if script.rig is None:
            return start(None, True)
        try:
            return start(script.rig)
        except RigError:
            return start(None, True)

    def close(self) -> None:
        """Do nothing: there is no process."""

    def _offer(self, writer) -> None:
        if not self.full:
            self._send(writer)

    def happen(self, verb: str, argument=None) -> None:
        """Carry out one event of a script now."""
        board = self.board
        if verb == "rx":
            if board.hal.port.open:
                board.receive(argument)
        elif verb in ("open", "close"):
            board.open_port(verb == "open")
        elif verb == "pin":
            board.set_input(*argument)
        elif verb == "hold":
            self._held = argument
        elif verb == "skip":
            self._off = argument
        elif verb == "prompt":
            if not self._held and not self._off and not self.full:
                board.hal.port.ask()
        elif verb in ("full", "drain"):
            self.full = verb == "full"
            if self.recorder:
                self.recorder.full(self.full)
        else:
            raise ValueError(verb)

    def step(self) -> None:
        """Do the tick and the pass of this millisecond; then the next begins."""
        board = self.board
        hal = board.hal
        hal.now_ns = self.ms * _MS + TICK_DELAY_NS
        if self._off:
            self._off -= 1
            self._missed += 1
        else:
            while self._missed:
                self._missed -= 1
                hal.tick()
            hal.tick()
            if self._held:
                self._held -= 1
            else:
                board.controller.poll(hal.ticks_ms())
        if hal.port.outgoing:
            self.sent.append((self.ms, board.transmit()))
        self.ms += 1
        hal.now_ns = self.ms * _MS

    def play_until(self, ms: int) -> None:
        """Play everything before this millisecond."""
        events = self.script.events
        while self.ms < ms:
            while self._next < len(events) and events[self._next][0] <= self.ms:
                self.happen(*events[self._next][1:])
                self._next += 1
            self.step()

    def play(self) -> None:
        """Play the whole script."""
        self.play_until(self.script.end)


def main() -> None:
    """`python -m host_tests.script_player FILE`: print the board's output, line by line, and the
    positions."""
    with open(Path(sys.argv[1])) as file:
        player = Player(parse(file))
    player.play()
    for ms, data in player.sent:
        print(ms, data.hex())
    print(json.dumps([player.board.steps(motor) for motor in range(player.board.hal.motors)]))


if __name__ == "__main__":
    main()
