"""The RGB LED on the emulated board: the bits on its pin, their times, and the motors' edges
meanwhile."""

import numpy as np
import pytest

from framestep_tools.building.board_files import board_data
from framestep_tools.payloads import MotorMove
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.end_to_end.io.test_led import CONNECTED, FAULT, MOVING, WAITING
from host_tests.end_to_end.session import Session

BLUE, WHITE, GREEN, RED = "b", "grb", "g", "r"
BEAT_NS = 128_000_000
RESET_NS = 280_000  # WS2812B: after this time the LED shows what it got


class LitBoard(EmulatedBoard):
    """Keeps the output of the LED's pin."""

    def __init__(self, name):
        super().__init__({"virtuals": 0, "estop": "no"}, board=name)
        self.data = board_data(name)
        self.light = []
        self.kept = []
        self.colour = ""  # the colour that it shows
        self.emulator.trace_start([*self.pins.pins, self.data["rgb"]])

    def _take(self):
        records = self.emulator.trace_read()
        self.light.append(records[records["pin"] == self.data["rgb"]].copy())
        self.kept += self._decoder.feed(records)

    def edges(self):
        self._take()
        kept, self.kept = self.kept, []
        return kept

    def words(self):
        """Return [(time of its end in ns, its colours)] of each word sent to the LED since the last
        call.

        An incomplete word is left for the next call.
        """
        self._take()
        records = np.concatenate(self.light)
        times, levels = records["t"].astype(np.int64), records["level"]
        rise, fall = times[levels == 1], times[levels == 0]
        # the first record is the level at the start
        fall = fall[fall > rise[0]] if len(rise) else fall[:0]
        whole = min(len(rise), len(fall)) // 24 * 24
        self.light = [records[times >= rise[whole]] if whole < len(rise) else records[:0]]
        rise, fall = rise[:whole], fall[:whole]
        high, period = fall - rise, np.diff(rise)
        within = np.arange(1, len(rise)) % 24 != 0
        one = high > 525
        assert ((high >= 200) & (high <= 500) | one & (high >= 550) & (high <= 1000)).all(), (
            np.unique(high)
        )
        assert (period[within] >= 1100).all(), np.unique(period[within])
        assert (period[within] <= 2000).all(), np.unique(period[within])
        assert (rise[24::24] - fall[23:-1:24] > RESET_NS).all()
        bits = np.pad(one.reshape(-1, 24), ((0, 0), (8, 0)))
        sent = [
            (int(end), colours(word))
            for end, word in zip(
                fall[23::24], np.packbits(bits, axis=1).view(">u4")[:, 0], strict=True
            )
        ]
        if sent:
            self.colour = sent[-1][1]
        return sent


def colours(word):
    """Return the colours in a word, in the order in which they are sent."""
    return "".join(name for name, shift in (("g", 16), ("r", 8), ("b", 0)) if word >> shift & 0xFF)


def assert_shows(session, pattern, wanted, beats=16):
    """Check the pattern, or its first beats if they repeat, in the middle of each beat. It may
    begin anywhere."""
    board = session.board
    board.words()
    sent = [(0, board.colour)]
    start = board.now_ns
    session.run((beats + 1) * BEAT_NS * 1e-9)
    sent += board.words()
    phase = (sent[1][0] - start) % BEAT_NS if len(sent) > 1 else 0
    middles = [start + phase + (k + 0.5) * BEAT_NS for k in range(beats)]
    levels = [[shown for end, shown in sent if end <= middle][-1] for middle in middles]
    assert "".join("*" if shown else "." for shown in levels) in 3 * pattern
    assert set(levels) - {""} == {wanted}


@pytest.mark.parametrize(
    ("name", "motors"),
    [pytest.param("skr_pico", 4, marks=pytest.mark.repeats), ("fysetc_erb", 2)],
)
def test_light(name, motors):
    """From waiting to a fault. (fysetc_erb: in one PIO block with the motors; skr_pico: in another
    block.)"""
    with LitBoard(name) as board:
        session = Session(board, motors=motors, reply_s=0.1)
        session.run(0.3)
        assert_shows(session, CONNECTED, WHITE, 4)
        if name == "skr_pico":
            session.leave()
            board.run_until(board.now_ns + 10**9)
            assert_shows(session, WAITING, BLUE)
            session.come_back().run(0.3)
            assert_shows(session, CONNECTED, WHITE, 4)
        session.speed(1, 10_000, 50_000).forget().accept(MotorMove(1, 30_000)).run(0.3)
        assert_shows(session, MOVING, GREEN, 6)
        board.emulator.set_pin(board.data["estop"], 0)
        session.run(0.5)
        times, _ = session.steps(1)
        cruise = np.diff(times[(times > times[0] + 0.3) & (times < times[0] + 1)])
        assert len(cruise) > 6_000, "edges are moved"
        assert np.ptp(cruise) < 0.2e-6, "edges are moved"
        assert session.made(1) == session.position(1) < 30_000
        assert_shows(session, FAULT, RED)
