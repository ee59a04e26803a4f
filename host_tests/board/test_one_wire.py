"""The FYSETC ERB on the emulated board: each driver's UART is one pin, which PIO writes and reads.
The test decodes the bits on the pins, and chips answer on the same pins, bit by bit."""

import numpy as np

from framestep_tools.payloads import GetCondition, Hi, MotorMove
from framestep_tools.simulator import driver_chips as chip
from framestep_tools.simulator.boards import EmulatedBoard
from framestep_tools.simulator.driver_chips import Chip, Chips
from host_tests.end_to_end.session import Session

PINS = (20, 17)  # v1
RIG = {
    "virtuals": 0,
    "motors": [
        {"driver": {"run_ma": 800, "pin": 20}},
        {"driver": {"run_ma": 300, "both_edges": True}},
    ],
}
BIT_NS = 1e9 / chip.BAUD
SLICE_NS = 500_000
QUIET_BITS = 12  # without an edge: no telegram is under way
WRITES = 12  # registers to set
SET_UP_S = 2.0  # the longest time for it


def decode(times, levels, until):
    """Return [(start, byte)] of the characters whose stop bit comes before `until`: 8N1."""
    found = []
    at = 0
    while at < len(times):
        start = times[at]
        if levels[at] or start + 10 * BIT_NS > until:
            at += 1
            continue
        samples = np.searchsorted(times, start + BIT_NS * np.arange(0.5, 10), side="right") - 1
        bits = levels[samples]
        assert bits[0] == 0, "no start or stop bit"
        assert bits[9] == 1, "no start or stop bit"
        found.append((start, int(np.packbits(bits[1:9], bitorder="little")[0])))
        at = int(np.searchsorted(times, start + 9.5 * BIT_NS))
    return found


class DrivenBoard(EmulatedBoard):
    """A board with chips on the pins, while time passes here."""

    def __init__(self):
        super().__init__(RIG, board="fysetc_erb")
        self.chips = [Chip(0), Chip(0)]
        self.wire = Chips(self.chips, lambda: self.now_ns, apart=True)
        self.kept = []
        self.bit_lengths = []
        for pin in PINS:
            self.emulator.set_pin(pin, None)
        begun = self.emulator.ns
        self.emulator.reset()  # the chips receive from the first bit of this start
        self.emulator.trace_start([*self.pins.pins, *PINS])
        self._records()  # the first levels of the pins
        while not self._configured(begun):
            self.run_until(self.now_ns + 20 * SLICE_NS)

    def _configured(self, since):
        """Whether the host has found the board's ports since then."""
        return any(
            event["type"] == "usb-configured" and event["t"] >= since
            for event in self.emulator.events()
        )

    def edges(self):
        kept, self.kept = self.kept, []
        return kept

    def _records(self):
        records = self.emulator.trace_read()
        self.kept += self._decoder.feed(records)
        return records

    def run_until(self, ns, until_output=False):
        while self.now_ns < ns:
            super().run_until(min(ns, self.now_ns + SLICE_NS), until_output)
            self._serve()
            if until_output:
                return

    def _serve(self):
        """Receive the bytes of this slice, until all telegrams have ended, and answer."""
        records = self._records()
        talks = [pin for pin in PINS if (records["pin"] == pin).any()]
        if not talks:
            return
        latest = self.now_ns
        while self.now_ns < latest + QUIET_BITS * BIT_NS:
            super().run_until(self.now_ns + round(10 * BIT_NS))
            records = np.concatenate([records, self._records()])
            latest = max(latest, int(records["t"][np.isin(records["pin"], PINS)].max()))
        for motor, pin in enumerate(PINS):
            mine = records[records["pin"] == pin]
            times, levels = mine["t"].astype(np.int64), mine["level"]
            self.bit_lengths += [d for d in np.diff(times) if d < 1.2 * BIT_NS]
            self.wire.select(motor)
            for at, value in decode(times, levels, self.now_ns):
                self.wire.byte(value, at)
            for value in self.wire.take_answers()[-8:] if self._asked() else b"":
                for bit in (0, *(value >> i & 1 for i in range(8)), 1):
                    self.emulator.set_pin(pin, bit)
                    super().run_until(self.now_ns + round(BIT_NS))
            self.emulator.set_pin(pin, None)
        self._records()

    def _asked(self):
        """Whether the last telegram gets an answer: 8 bytes after the echo of 4."""
        return len(self.wire.telegrams) > 0 and len(self.wire.telegrams[-1][1]) == 4


def test_set_up_over_one_pin_each():
    """PIO also has pulses for one motor and steps on both edges for the other here, and so no room
    for the LED's program."""
    with DrivenBoard() as board:
        talk = Session(board, motors=2, reply_s=0.1)
        assert talk.ask(Hi()).motors == 2
        limit = talk.now + SET_UP_S
        while any(len(driver.writes) < WRITES for driver in board.chips) and talk.now < limit:
            talk.run(0.05)
        talk.run(0.1)  # and no more follows
        for driver, run_ma in zip(board.chips, (800, 300), strict=True):
            assert driver.damaged == 0
            assert len(driver.writes) == WRITES
            assert driver.gstat == 0
            assert run_ma - 55 < driver.run_ma() <= run_ma
        assert abs(np.mean(board.bit_lengths) / BIT_NS - 1) < 0.01
        talk.forget().accept(MotorMove(1, 300), MotorMove(2, -200)).wait_idle()
        assert (talk.made(1), talk.made(2)) == (300, -200)
        assert talk.ask(GetCondition()).bits == 0
