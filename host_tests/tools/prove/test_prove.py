"""`framestep lab prove`: verdicts, reports, what stamps mean. host_tests/board/test_prove.py tests
the measurements."""

import json
import shutil
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from framestep_tools import payloads as p
from framestep_tools.building import board_files
from framestep_tools.building.board_files import ROOT, board_data, boards_that_see_steps
from framestep_tools.cli import app
from framestep_tools.client import port_finder
from framestep_tools.client.client import BrokenOff, Client
from framestep_tools.errors import BROKEN_OFF, FAILED, INTERRUPTED
from framestep_tools.prove import flash, report
from framestep_tools.prove.board import Board, real
from framestep_tools.prove.borrowed_machines import Borrowed, CannotCapture, Registry
from framestep_tools.prove.check import check
from framestep_tools.prove.chips import CHIPS
from framestep_tools.prove.figures import (
    AS_EMULATED,
    BETTER,
    FIGURES,
    LESS,
    MORE,
    NOT_COMPARED,
    NOT_MEASURED,
    OF_THE_RIG,
    SAME,
    WORSE,
    Figure,
)
from framestep_tools.prove.machine_choice import Layout, layout
from framestep_tools.prove.measure import Measuring
from framestep_tools.prove.pins import HELD, RATES, trapezoids
from framestep_tools.prove.stamp_program import program, times_ns
from framestep_tools.simulator.boards import LockstepPort, SimulatedBoard

HZ = 125_000_000


@pytest.mark.parametrize(
    "better, measured, verdict",
    [
        (LESS, 110, AS_EMULATED), (LESS, 89, BETTER), (LESS, 111, WORSE), (MORE, 111, BETTER),
        (MORE, 89, WORSE), (SAME, 89, WORSE), (SAME, 111, WORSE), (SAME, 90, AS_EMULATED),
        (LESS, None, NOT_MEASURED),
    ],
)  # fmt: skip
def test_verdicts(better, measured, verdict):
    figure = Figure("figure", "µs", better, 2, 0.1, "")
    assert figure.verdict(measured, 100) == verdict
    assert figure.verdict(measured, None) == (NOT_COMPARED if measured else NOT_MEASURED)


def test_the_slack_holds_where_the_share_is_less():
    figure = Figure("figure", "µs", LESS, 2, 0.1, "")
    assert figure.verdict(3, 1) == AS_EMULATED
    assert figure.verdict(3.1, 1) == WORSE


def execute(words, level, cycles):
    """Run the program on a pin with level(cycle) at each cycle; return what it pushes."""
    x, isr, at, pushed = 0xFFFFFFFF, 0, 6, []
    for cycle in range(cycles):
        word, following = words[at], 6 if at == 7 else at + 1  # the wrap
        if word == 0xA0C1:
            isr = x
        elif word == 0x8000:
            pushed.append(isr)
        elif word >> 13 == 0:
            taken = x != 0 if word >> 5 & 7 == 2 else level(cycle)
            assert word >> 5 & 7 in (2, 6)
            if word >> 5 & 7 == 2:
                x = (x - 1) & 0xFFFFFFFF
            following = word & 31 if taken else following
        else:
            assert word == 0xA042
        at = following
    return np.array(pushed, np.uint32)


@pytest.mark.parametrize("both", [True, False])
def test_stamps_are_within_the_loop(both):
    """Execute the program word by word on pulses of various lengths."""
    lengths = np.random.default_rng(1).integers(5, 300, 200)
    edges = np.cumsum(lengths)
    stamps = execute(
        program(0, both),
        lambda cycle: bool(np.searchsorted(edges, cycle, side="right") & 1),
        edges[-1] + 20,
    )
    seen = edges if both else edges[::2]
    assert len(stamps) == len(seen)
    off = times_ns(stamps, both, 0, HZ) / 8 - seen
    assert np.ptp(off) <= 2
    later = times_ns(stamps[7:], both, 7, HZ)
    assert np.allclose(later, times_ns(stamps, both, 0, HZ)[7:])


@pytest.mark.parametrize("fps_milli", [23_976, 24_000, 60_000])
def test_the_motors_of_a_run_begin_and_end_at_rest(fps_milli):
    for rate, steps in zip(RATES, trapezoids(fps_milli), strict=True):
        assert len(set(steps[: HELD + 1])) == 1
        assert len(set(steps[-HELD - 1 :])) == 1
        assert np.diff(steps).min() >= 0
        assert np.diff(steps).max() * fps_milli / 1000 == pytest.approx(rate, rel=0.05)


def test_every_figure_is_known_of_the_emulated_boards_and_explained():
    """Except for DMX on a board without it."""
    boards = report.emulated_boards()
    assert not report.outdated(), 'run make prove ARGS="--board NAME --renew"'
    for name in boards_that_see_steps():
        dmx = "dmx" in board_data(name)
        figures = {f.key for f in FIGURES if dmx or not f.key.startswith("dmx")}
        assert set(boards[name].figures) == figures
    page = (ROOT / "docs/use/hardware-reports.md").read_text()
    assert [f.key for f in FIGURES if f"`{f.key}`" not in page] == []


def test_what_depends_on_the_rig_file_is_compared_with_the_same_only():
    pico = report.emulated_boards()["pico"]
    assert pico.beside(8, True) == pico.figures
    assert set(pico.figures) - set(pico.beside(4, True)) == OF_THE_RIG
    assert pico.beside(8, False) == pico.beside(4, True)


def test_a_run_without_an_edge_at_constant_velocity_has_no_such_figure():
    """The ERB's two motors at 23.976 frames/s; another rate gives the figure."""
    measuring = Measuring.__new__(Measuring)
    measuring.figures = {}
    for values in ([], [np.nan]):
        measuring._note_largest("edge_steady_us", np.array(values))
        assert measuring.figures == {}
    measuring._note_largest("edge_steady_us", np.array([1.0, np.nan, 3.0, 2.0]))
    assert measuring.figures == {"edge_steady_us": 3.0}


def a_report(**figures):
    emulated = report.emulated_boards()["pico"].figures
    return report.Report(
        "pico", "emulated", HZ, "MicroPython", {**emulated, **figures}, [], emulated
    )


def test_a_report(tmp_path):
    found = a_report(late_us=100_000.0)
    assert found.worse == ["late_us"]
    data, page = found.write(tmp_path / "folder")
    assert json.loads(data.read_text())["verdicts"]["late_us"] == WORSE
    assert "| late_us | 100 000 | " in page.read_text()


def test_a_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(report.ToolError, match="cannot write"):
        a_report().write(tmp_path / "file")


@pytest.fixture
def figures(tmp_path, monkeypatch):
    """Let the figures be in a file that a test may change."""
    copied = Path(shutil.copy(report.EMULATED, tmp_path))
    monkeypatch.setattr(report, "EMULATED", copied)
    return copied


@pytest.mark.parametrize("key", ["clock_mhz", "motors"])
def test_figures_of_another_clock_or_count_are_out_of_date(figures, monkeypatch, key):
    assert report.outdated() == []
    board_data = board_files.board_data
    monkeypatch.setattr(
        board_files,
        "board_data",
        lambda name: board_data(name) | ({key: 1} if name == "pico2" else {}),
    )
    assert report.outdated() == ["pico2"]
    report.renew("pico2", 1 if key == "motors" else 12, {"late_us": 7.0})
    assert report.outdated() == []
    assert report.emulated_boards()["pico2"].figures == {"late_us": 7.0}


def test_figures_of_a_new_version_and_of_the_boards_that_there_are(figures, monkeypatch):
    text = figures.read_text()
    figures.write_text(text.replace('"skr_pico"', '"gone"'))
    assert report.outdated() == ["skr_pico"]
    report.renew("skr_pico", 4, {})
    assert sorted(report.emulated_boards()) == boards_that_see_steps()
    monkeypatch.setattr(report, "version", lambda: "9.9.9")
    assert report.outdated() == boards_that_see_steps()
    report.renew("pico", 8, {})
    assert list(report.emulated_boards()) == ["pico"]


def test_figures_of_another_version_are_not_compared(figures):
    figures.write_text('{"framestep": "0.0.1", "boards": {}}')
    with pytest.raises(report.ToolError, match=r"of framestep 0\.0\.1"):
        report.emulated_boards()


def test_it_asks_before_pins_move(monkeypatch, capsys):
    """It says which drivers to unplug, and opens no port before."""
    asked = []
    monkeypatch.setattr("typer.confirm", lambda text, **_: asked.append(text))
    assert app.status(["lab", "prove", "/dev/none"]) == 130
    assert app.status(["lab", "prove", "/dev/none", "--with-drivers"]) == 130
    assert "enable pins" in asked[0]
    assert "motors turn" in asked[1]


def prove_by(measure, monkeypatch, folder):
    """Return the status of the command with another measurement, of a board that is not there."""
    board = SimpleNamespace(
        client=None, run=lambda code: "MicroPython v1.26.1", rig={}, folder="pico", where="here",
        clock_hz=HZ, layout=layout(PICO, {}, set(), [0, 1]), overlay=0, drivers_off=nullcontext,
        settings=lambda motor: {},
    )  # fmt: skip
    monkeypatch.setattr("framestep_tools.prove.board.real", lambda *_: nullcontext(board))
    monkeypatch.setattr(Measuring, "everything", measure)
    return app.status(["lab", "prove", "/dev/none", "--yes", "--out", str(folder)])


@pytest.mark.parametrize(
    ("error", "said", "status"),
    [
        (report.ToolError("the board stumbled"), "the board stumbled", FAILED),
        (BrokenOff("the cable was pulled"), "the cable was pulled", BROKEN_OFF),
        (OSError(5, "Input/output error"), "Input/output error", BROKEN_OFF),
        (KeyboardInterrupt(), "Ctrl-C", INTERRUPTED),
        (ValueError("a fault of this tool"), "a fault of this tool", None),
    ],
)
def test_what_was_measured_before_it_broke_off_is_kept(
    error, said, status, monkeypatch, tmp_path, capsys
):
    def measure(self):
        self.figures["upload_frames"] = 10_000
        raise error

    with pytest.raises(type(error)) if status is None else nullcontext():
        assert prove_by(measure, monkeypatch, tmp_path) == status
    data, page = sorted(tmp_path.iterdir())
    printed = capsys.readouterr().err.splitlines()[-1]
    assert "the measurement broke off: " in printed
    assert printed.endswith(f"{said}; {page} has the figures so far")
    kept = json.loads(data.read_text())
    assert kept["figures"]["upload_frames"] == 10_000
    assert said in kept["complaints"][-1]
    assert said in page.read_text()


def test_nothing_is_written_if_nothing_was_measured(monkeypatch, tmp_path):
    def interrupted(self):
        raise KeyboardInterrupt

    assert prove_by(interrupted, monkeypatch, tmp_path) == INTERRUPTED
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("error", [KeyboardInterrupt(), report.ToolError("stumbled")])
@pytest.mark.parametrize("second", [report.ToolError("the board has gone"), ValueError("''")])
def test_the_first_error_is_reported_if_the_pins_cannot_be_given_back(error, second):
    """A lost port, or an answer that Ctrl-C has cut short, raises another one while the enable
    pins are given back."""
    writes = []

    def put(*words):
        writes.append(words)
        if len(writes) > 1:
            raise second

    board = Board.__new__(Board)
    board.data, board.rig, board._chip = {"enable": 8}, {}, CHIPS["rp2040"]
    board.instrument = SimpleNamespace(get=lambda registers: [0 for _ in registers], put=put)
    with pytest.raises(type(error)) as raised, board.drivers_off():
        raise error
    assert raised.value is error
    assert len(writes) == 2


class Silent:
    """A client and a REPL of a board that only identifies itself."""

    def __init__(self, name, chip):
        self.data = {"name": name, "chip": chip, "step": [1, 2, 3, 4]}

    def request(self, _message):
        return None

    def run(self, code):
        return json.dumps(self.data) if "dumps" in code else "1000"


@pytest.mark.parametrize(
    "name, chip, expected, text",
    [
        ("Raspberry Pi Pico", "esp32", None, "cannot measure itself"),
        ("Raspberry Pi Pico", "esp32", "pico", "cannot measure itself"),
        ("Raspberry Pi Pico", "rp2040", "skr_pico", "is pico .*, not skr_pico: .*--board pico"),
    ],
)
def test_a_board_that_is_another_one_or_cannot_watch_itself(name, chip, expected, text):
    silent = Silent(name, chip)
    with pytest.raises(report.ToolError, match=text):
        Board(silent, silent.run, {}, "here", expected)


def test_a_board_that_there_is_not(capsys):
    """It is refused before the tool looks for a port."""
    assert app.status(["lab", "prove", "--board", "nano", "--yes"]) != 0
    assert "no board 'nano': there are" in capsys.readouterr().err


def test_a_board_with_one_port_is_refused_before_a_ctrl_c(monkeypatch):
    one = port_finder.Port("/dev/one", port_finder.SINGLE, "board", "framestep", "1", 0)
    monkeypatch.setattr(port_finder, "listed", lambda: [one])
    for device, port in ((None, None), ("/dev/one", None), (None, "/dev/one")):
        with (
            pytest.raises(report.ToolError, match='set "ports" to 2'),
            real(device, port, None, print),
        ):
            pass


def test_the_flash_of_what_the_board_says():
    """A page's time, without the time of the call, from rounds that nothing disturbed. The sector
    of the file may not be found, or there is no room for it."""
    found = flash.measure(lambda code: "[121000, 46000, 1000, 4700, 45000, 1500, 4200]\r\n")
    assert found == pytest.approx((121.0, 45.5, 0.4))
    assert flash.measure(lambda code: "[121000]") == (121.0, None, None)
    with pytest.raises(report.ToolError, match=r"cannot write a file of 4 kB .*delete files"):
        flash.measure(lambda code: "'OSError(28,)'")


# ---- which machines watch


PICO = {"step": list(range(8))}


def test_half_of_the_motors_watch_the_other_half():
    found = layout(PICO, {}, set(), [0, 1])
    assert found.groups == [(1, 2, 3, 4), (5, 6, 7, 8)]
    assert found.watchers(found.groups[0]) == [4, 5, 6, 7]
    assert found.watchers(found.groups[1]) == [0, 1, 2, 3]
    assert found.watchers([1, 2, 3, 4, 5, 6, 7]) == [7]
    assert found.watchers(range(1, 9)) == []
    found.check()


def test_machines_that_nobody_has_come_first():
    found = layout({"step": [1, 2, 3, 4, 5]}, {}, {5, 6, 7}, [0, 1])
    assert found.watchers((1, 2, 3, 4)) == [5, 6, 7, 4]
    assert found.watchers(range(1, 6)) == [5, 6, 7]


def test_the_third_block_of_an_rp2350_watches_all_motors():
    found = layout(PICO, {"motor_count": 8}, {8, 9, 10, 11}, [0, 1, 2])
    assert found.watchers(range(1, 9)) == [8, 9, 10, 11]


def test_a_servo_is_neither_measured_nor_borrowed():
    rig = {"motors": [{}, {"servo": {}}, {"backlash": 3}, {"jerk": 5, "backlash": 0}, None]}
    found = layout(PICO, rig, set(), [0, 1])
    assert found.groups == [(1,), (5, 6, 7, 8)]
    assert found.left_out == {3: "has backlash", 4: "has jerk"}
    edges = {"motors": [{"driver": {"run_ma": 500, "both_edges": True}}]}
    assert layout(PICO, edges, set(), [0, 1]).left_out == {1: "steps on both edges"}
    assert found.watchers((5, 6, 7, 8)) == [0, 2, 3]


@pytest.mark.parametrize(
    "found, text",
    [
        (Layout(2, (), {}, {3}, [1]), "too few of the chip's state machines .* motors 1 to 2"),
        (Layout(2, (), {}, {3, 4, 5}, []), "too few"),
        (Layout(1, (), {1: "has jerk"}, range(1, 8), [0, 1]), "motor 1 has jerk"),
        (Layout(1, (1,), {}, range(1, 8), [0, 1]), "all are servos"),
    ],
)
def test_a_layout_that_does_not_suffice(found, text):
    with pytest.raises(report.ToolError, match=text):
        found.check()


class Memory(Registry):
    """A board's registers as plain memory; two machines of block 2 wait for commands."""

    base = 0x50400000
    code = 18  # where the motors' program begins

    def __init__(self):
        super().__init__(self.answer)
        self.words = {self.base: 0b0111}
        for machine in range(3):
            at = self.base + 0xC8 + 0x18 * machine
            self.words |= {at: 0x20000 + machine, at + 4: 0x16B00, at + 8: 1 << 30}
            self.words |= {at + 12: self.code, at + 16: 0x80A0, at + 20: 0x1234}
        self.instructions = {self.base + 0xC8 + 0x18 * machine + 16 for machine in range(4)}
        self.before = dict(self.words)
        self.written = []

    def answer(self, code):
        if "addressof" in code:
            return "536870912 64 40960"
        if "rp2.DMA()" in code:
            return "[2, 3, 4, 5]"
        if code.startswith("put"):  # the call that starts them, and the time
            self.put(tuple(map(int, code[4 : code.index(")")].split(","))))
            return "[0]"
        return "10"

    def put(self, *pairs):
        self.written += pairs
        for address, word in pairs:
            register = address & ~0x3000
            if address & 0x3000 == 0x3000:
                word = self.words[register] & ~word
            elif address & 0x3000 == 0x2000:
                word = self.words[register] | word & 15  # the other bits act, and read as 0
            if register not in self.instructions:  # instructions act
                self.words[register] = word

    def get(self, *addresses):
        return [self.words.get(address, 0) for address in addresses]


def test_what_is_borrowed_of_an_rp2350_and_given_back():
    """By RP2350 datasheet 12.6: channel control, requests 20 and 21 of block 2's FIFOs."""
    memory = Memory()
    borrowed = Borrowed(memory, CHIPS["rp2350"], [8, 9], [4, 6], True, 0, 1000)
    borrowed.begin()
    for keep, drop, request in ((2, 3, 20), (4, 5, 21)):
        for channel, other, increments in ((keep, drop, 1), (drop, keep, 0)):
            word = memory.words[0x50000000 + 0x40 * channel + 0x10]
            assert word & 1, "enabled"
            assert word >> 2 & 3 == 2, "words"
            assert (word >> 4 & 3, word >> 6 & 3) == (0, increments)
            assert word >> 13 & 15 == other
            assert word >> 17 & 63 == request
            assert word >> 23 & 1, "no interrupt"
    assert (0x50000450, 1 << 2 | 1 << 4) in memory.written
    assert memory.words[memory.base] == 0b0111
    borrowed.end()
    assert (0x50000464, 0b111100) in memory.written
    for address, word in memory.before.items():
        assert memory.words[address] == word, hex(address)


def test_machines_that_do_not_wait_are_left_alone():
    memory = Memory()
    memory.words[memory.base + 0xC8 + 16] = 0x0042
    with pytest.raises(CannotCapture, match="stop all motors"):
        Borrowed(memory, CHIPS["rp2350"], [8, 9], [4, 6], True, 0, 1000).begin()
    assert not memory.written


# ---- questions before anything moves


@pytest.mark.parametrize(
    "rig, requests, text",
    [
        ({"estop": "no"}, [p.MotorSetLimits(2, 0, 0, 0, 0, 0)], None),
        ({}, [p.MotorSetLimits(2, 1, -20_000, 1, 200_000, 0)], None),
        ({}, [p.MotorSetLimits(2, 1, -20_000, 1, 2000, 0)], "soft limits of motor 2"),
        ({}, [p.MotorSetLimits(3, 1, -10, 0, 0, 0)], "soft limits of motor 3"),
        ({}, [p.MotorConfigure(1, 0)], "motor 1 is switched off"),
        ({"limits": [{"low": 27}]}, [p.MotorSetLimits(2, 0, 0, 0, 0, 1)], "at a limit switch"),
        ({"estop": "nc"}, [], "the E-stop is held"),
    ],
)
def test_what_would_be_refused_is_reported_before_anything_moves(rig, requests, text):
    with SimulatedBoard(rig) as board:
        client = Client(LockstepPort(board))
        client.wait_event(p.DeviceInfo, 10)
        for request in requests:
            client.request(request)
        stand = client.request(p.MotorGetPosition()).steps
        with pytest.raises(report.ToolError, match=text) if text else nullcontext():
            check(client, [1, 2, 3], stand)
