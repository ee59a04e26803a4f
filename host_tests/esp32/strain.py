"""Any requests in any order on the simulated ESP32, through its UART, while its main loop pauses
and its E-stop is pressed: host_tests/board/strain.py on another board.

    python -m host_tests.esp32.strain --seed 7 --requests 5000

A pause is no longer than the queue, so it is no fault. The UART does not show whether a host is
there, so none leaves. An E-stop loses positions, so they are compared only if there was none.
"""

import argparse

from framestep_tools.building.board_files import board_data
from framestep_tools.simulator.esp32_board import BOARD, Esp32Board
from host_tests.board.strain import Strain

RIG = {"estop": "nc", "motor_count": 4}
PAUSES_MS = (0, 0, 0, 1, 5, 15)


class ChainStrain(Strain):
    """See Strain; without a REPL, as the protocol has its port."""

    estop_pin = board_data(BOARD)["estop"]
    cut = False  # the E-stop was pressed since the last check

    def begin(self):
        """There is no REPL."""

    def press(self, on):
        self.cut |= on
        self.board.set_pin(self.estop_pin, int(on))

    @property
    def lost(self):
        return super().lost or self.cut

    def work(self):
        if pause := self.dice.choice(PAUSES_MS):
            self.counts["pauses"] += 1
            self.board.pause(pause)

    def leave(self):
        self.pass_time(self.dice.choice((30, 300)))

    def check(self):
        super().check()
        self.cut = False

    def end(self):
        """Give the REPL back, and see that nothing else has ended the firmware."""
        self.board.receive(b"\r\x03")
        self.board.run_until(self.board.now_ns + 500_000_000)
        said = self.board.transmit().decode(errors="replace")
        if "KeyboardInterrupt" not in said or "fault in the firmware" in said:
            raise self.broken(f"the firmware is not alive: {said}")
        return self


def strain(seed, requests, say=print):
    with Esp32Board(RIG) as board:
        board.wire_switches()
        return ChainStrain(board, seed, say).run(requests)


def main():
    parser = argparse.ArgumentParser(description="requests on the simulated ESP32")
    parser.add_argument("--requests", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    if args.requests < 1:
        parser.error("--requests has to be 1 or more")
    strain(args.seed, args.requests).report()


if __name__ == "__main__":
    main()
