"""The page of `make try`: framestep on an emulated board that runs in the browser tab."""

import base64
import contextlib
import os
import re
import time
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect
from rich.console import Console

from flash_images.uf2 import RP2040, RP2350
from framestep_emulator.trace import edges_from
from framestep_tools import demo
from framestep_tools.building import images
from framestep_tools.client.client import Client
from framestep_tools.judge.judge import judge
from framestep_tools.judge.reference import Reference
from framestep_tools.judge.trace import PinDecoder, Trace, load_board
from framestep_tools.move.move_display import MoveDisplay
from framestep_tools.move.move_file import CAMERA_MOVE, read_move
from framestep_tools.simulator.boards import EmulatedBoard, LockstepPort
from framestep_tools.site import try_page
from host_tests.console import looking as ui

FPS_MILLI = 24_000
CLOCK_NS = 1000  # a motor that starts reads the chip's microsecond clock
CYCLE_NS = 10  # of the pulse engine at the Pico's 200 MHz
RUN_NS = 238 * 10**9 // 24 + 100_000  # from the second frame to the last, with the step to it
SHORT = 51, 74  # frames of the example move in which all motors move
PACKAGES = ["@xterm/addon-fit", "@xterm/xterm", "rp2040js"]  # what the page is made of
# Keeps what the worker says of its pins, from the first moment on
KEEP_EDGES = """
    globalThis.kept = [];
    globalThis.Worker = class extends Worker {
        constructor(...given) {
            super(...given);
            this.addEventListener('message', ({data}) => {
                if (data.is === 'edges') kept.push(data.records);
            });
        }
    };
"""
TAKE_EDGES = """() => new Promise((resolve) => {
    const reader = new FileReader();
    reader.onload = () => resolve(reader.result);
    reader.readAsDataURL(new Blob(kept));
})"""
# Columns of a row of the scope in which its pin has an edge
EDGE_COLUMNS = """(canvas, row) => {
    const scale = canvas.width / canvas.clientWidth;
    const from = Math.ceil(140 * scale);
    const line = canvas.getContext('2d').getImageData(from, Math.round((row * 22 + 11) * scale), canvas.width - from, 1);
    return line.data.filter((value, i) => i % 4 === 3 && value > 128).length;
}"""  # noqa: E501


@pytest.fixture(scope="module")
def make_site(tmp_path_factory, shared_stage):
    """Make the page with a rig file for the board; return its address."""

    def make(rig):
        folder = tmp_path_factory.mktemp("try")
        try_page.make(folder, rig)
        return shared_stage.files(folder)

    return make


@pytest.fixture(scope="module")
def url(make_site):
    return make_site(try_page.RIG)


@pytest.fixture
def page(stage, url):
    opened = stage.page("about:blank")
    opened.add_init_script(KEEP_EDGES)
    opened.goto(url)
    ui.wait_connected(opened)
    yield opened
    assert opened.errors == []


def type_on_repl(page, text):
    ui.card(page, "REPL").locator("textarea").focus()
    page.keyboard.type(text)
    page.keyboard.press("Enter")


def expect_on_repl(page, text):
    expect(ui.card(page, "REPL").locator(".xterm-rows")).to_contain_text(text)


@contextlib.contextmanager
def jog_up(page, distance):
    """Hold the button that jogs motor 1 up."""
    begin = ui.steps(page)
    page.get_by_role("button", name="Jog track up").focus()
    page.keyboard.down("Enter")
    ui.wait_far(page, 1, begin, distance)
    yield
    page.keyboard.up("Enter")
    ui.wait_rest(page)


def edge_columns(page, row):
    return ui.card(page, "Pins").locator("canvas").evaluate(EDGE_COLUMNS, row)


def use_console_and_repl(page, url):
    expect(page.locator("#who")).to_contain_text(try_page.RIG["name"])
    expect(page.locator("#rows li")).to_have_count(4)
    type_on_repl(page, "6 * 7000")
    expect_on_repl(page, "42000")
    licences = page.request.get(f"{url}licences.txt").text()
    assert re.findall(r"^(\S+) [\d.]+ \(", licences, re.MULTILINE) == PACKAGES
    assert all(asked.startswith(url) for asked in page.asked), page.asked


def watch_rig_and_scope(page):
    assert edge_columns(page, 0) == 0
    with jog_up(page, 300):
        assert edge_columns(page, 0) > 10
        assert edge_columns(page, 2) == 0  # the next motor's steps
    page.wait_for_timeout(500)
    assert edge_columns(page, 0) == 0
    expect(page.locator("#space")).to_be_visible()


def make_it_narrow(page):
    wide = page.viewport_size
    page.set_viewport_size({"width": 390, "height": 844})
    for view in ("Motors", "Move", "Rig file, load, terminal"):
        ui.go_to(page, view)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, view
    page.set_viewport_size(wide)
    ui.go_to(page, "Motors")
    show_board(page)


def show_board(page):
    """The drawer with scope and REPL."""
    if not ui.card(page, "Pins").is_visible():
        page.locator('[data-drawer="board"]:visible').click()


def switch_power_off_and_on(page):
    type_on_repl(page, "kept = 6 * 7000")
    page.get_by_role("button", name="Power off and on").click()
    expect(ui.log(page)).to_contain_text("The link has ended")
    ui.wait_connected(page)
    type_on_repl(page, "kept")
    expect_on_repl(page, "NameError")


def put_a_new_rig_file(page):
    """The page itself uses the REPL's port, then returns it to the terminal."""
    ui.go_to(page, "Rig file, load, terminal")
    page.get_by_role("button", name="Measure").click()
    expect(ui.card(page, "Load of the board").get_by_role("status")).to_contain_text("on average")
    rig = ui.card(page, "Rig file of the board")
    rig.get_by_label("Rig file").fill('{"name": "two motors", "motor_count": 2}')
    rig.get_by_role("button", name="Put onto the board").click()
    expect(rig.get_by_role("status")).to_have_text("two motors has restarted with it.")
    ui.go_to(page, "Motors")
    expect(page.locator("#rows li")).to_have_count(2)
    show_board(page)
    type_on_repl(page, "6 * 7001")
    expect_on_repl(page, "42006")


def test_console_repl_pins_power_and_a_new_rig_file(page, url):
    """In one page, since the board in it starts for seconds."""
    use_console_and_repl(page, url)
    watch_rig_and_scope(page)
    make_it_narrow(page)
    switch_power_off_and_on(page)
    put_a_new_rig_file(page)


def done(page, step):
    expect(ui.card(page, "Tour").get_by_role("listitem").nth(step)).to_have_class("done")


def show(page):
    where = ui.card(page, "Tour").get_by_role("button", name="Show me where")
    where.locator("visible=true").click()


def open_move(page, table):
    """Call the positions known, and set the speeds that the move needs."""
    ui.go_to(page, "Positions")
    page.get_by_role("button", name="All are as shown").click()
    page.get_by_role("button", name="Press again: all are known").click()
    ui.close_drawer(page)
    ui.go_to(page, "Move")
    page.get_by_label("Open a move").set_input_files(table)
    page.get_by_role("button", name="Raise the speeds to fit").click()
    expect(ui.log(page)).to_contain_text("Speeds are set: track")
    ui.close_drawer(page)


def prepare_run(page):
    page.locator("#ready").click()
    expect(page.locator("#banner")).to_contain_text("READY")
    page.locator("#go").click()


def page_edges(page, board):
    records = edges_from(base64.b64decode(page.evaluate(TAKE_EDGES).partition(",")[2]))
    return PinDecoder(load_board(board, try_page.RIG)).feed(records)


def judged(edges, move, start):
    """Return the trace, and the verdict, which is good. start: as for judge()."""
    trace = Trace.from_edges(edges)
    path = Reference(move.positions, FPS_MILLI, demo.ROLL_MS, demo.ROLL_MS)
    verdict = judge(trace, move.positions, FPS_MILLI, start, path=path)
    assert verdict.good, verdict.complaints
    return trace, verdict


def run_of(edges, move, start):
    """Return for each motor, from the second frame to the last, (times of its steps in ns after
    motor 1's step to the second frame, positions). start: as for judge()."""
    trace, verdict = judged(edges, move, start)
    times, after = trace.positions(1, start.get(1, 0))
    begin = times[(times > verdict.origin_ns) & (after == move.positions[1][1])][0]
    found = []
    for motor in move.positions:
        times, after = trace.positions(motor, start.get(motor, 0))
        run = (times >= begin) & (times < begin + RUN_NS)
        found.append((times[run] - begin, after[run]))
    return found


def demo_edges(move, folder):
    """Return the edges of `make demo`."""
    with EmulatedBoard() as board:
        recorder = demo.Recorder(board, folder / "trace.csv")
        with Client(LockstepPort(board)) as client:
            display = MoveDisplay(move.names, move.start_frame, move.end_frame, Console())
            demo.play(client, move, FPS_MILLI, recorder, display)
        recorder.trace()
    return recorder.edges


@pytest.mark.repeats
def test_the_tour_and_the_edges_of_its_run(page, tmp_path):
    """Every step in order; the run's edges match `make demo`."""
    with jog_up(page, 200):
        pass
    done(page, 0)
    start = {1: -ui.steps(page)}  # when its place is called 0
    show(page)
    page.get_by_role("button", name="Zero here").locator("visible=true").click()
    expect(ui.position(page)).to_have_text("0")
    ui.go_to(page, "Positions")
    page.get_by_role("button", name="All are as shown").click()
    page.get_by_role("button", name="Press again: all are known").click()
    done(page, 1)
    ui.close_drawer(page)
    show(page)
    ui.card(page, "Tour").get_by_role("button", name="Take the example").click()
    done(page, 2)
    show(page)
    prepare_run(page)
    expect(ui.log(page)).to_contain_text("Run 1 to 240 is over.")
    done(page, 3)
    ui.wait_rest(page)
    expect(page.get_by_label("Position of boom in deg")).to_have_text("24.375°")

    move = read_move(CAMERA_MOVE)
    made = run_of(page_edges(page, "pico"), move, start)
    expected = run_of(demo_edges(move, tmp_path), move, {})
    for motor, (found, wanted) in enumerate(zip(made, expected, strict=True), 1):
        assert len(found[0]) > 10_000, motor
        assert np.abs(found[0] - wanted[0]).max() <= CLOCK_NS + CYCLE_NS, f"times of motor {motor}"
        assert np.array_equal(found[1], wanted[1]), f"positions of motor {motor}"

    prepare_run(page)
    ui.wait_moving(page)
    estop = page.locator(".estop")
    estop.click()
    expect(ui.log(page)).to_contain_text("The E-stop was pressed.")
    ui.wait_rest(page)
    estop.click()
    done(page, 4)
    ui.card(page, "Tour").get_by_role("button", name="Type it for me").click()
    expect_on_repl(page, re.compile("E-stop|motor"))
    done(page, 5)
    expect(ui.card(page, "Tour").get_by_role("status")).to_contain_text("That was the tour")


def of_the_other_chip(route):
    """Answer with an image of a Pico whose blocks say that it is for an RP2350."""
    image = images.frozen("pico").with_suffix(".uf2").read_bytes()
    families = [family.to_bytes(4, "little") for family in (RP2040, RP2350)]
    route.fulfill(body=image.replace(*families))


def test_a_wrong_image_is_refused_and_a_pico_2_plays_a_move(stage, url, tmp_path):
    page = stage.page("about:blank")
    page.add_init_script(KEEP_EDGES)
    page.route("**/pico.uf2", of_the_other_chip)
    page.goto(f"{url}?board=none")  # an unknown one is the default
    refusal = "the image is for an RP2040, and the emulated chip is an RP2350"
    expect(ui.log(page)).to_contain_text(refusal)
    assert [refusal in error for error in page.errors] == [True]
    page.errors.clear()

    choice = page.get_by_label("Emulated board")
    expect(choice).to_have_value("pico")
    choice.select_option("Raspberry Pi Pico 2")
    page.wait_for_url(f"{url}?board=pico2")
    ui.wait_connected(page)
    expect(choice).to_have_value("pico2")
    table = tmp_path / "short.csv"
    first, last = SHORT
    header, *rows = CAMERA_MOVE.read_text().splitlines()  # the first row is frame 1
    table.write_text("\n".join([header, *rows[first - 1 : last]]))
    open_move(page, table)
    prepare_run(page)
    expect(ui.log(page)).to_contain_text(f"Run {first} to {last} is over.")
    ui.wait_rest(page)
    _, verdict = judged(page_edges(page, "pico2"), read_move(table), {})
    assert len(verdict.motors) == 4
    assert page.errors == []


def worker_seconds():
    """Return the processor time of the workers in this process's browsers."""
    ticks = 0
    for process in _descendants(os.getpid()):
        for thread in Path(f"/proc/{process}/task").glob("*"):
            with contextlib.suppress(OSError):  # a thread may end meanwhile
                if thread.joinpath("comm").read_text().startswith("DedicatedWorker"):
                    fields = thread.joinpath("stat").read_text().rpartition(")")[2].split()
                    ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def _descendants(process):
    for children in Path(f"/proc/{process}/task").glob("*/children"):
        for child in children.read_text().split():
            yield child
            yield from _descendants(child)


def frames_played(page, frame):
    """Wait until the play head is past a frame; return its position."""
    while (at := float(page.locator("#moving").text_content().split("Play head ")[1])) <= frame:
        page.wait_for_timeout(ui.LOOK_MS)
    return at


@pytest.mark.repeats  # runs of other tests, with all motors
def test_eight_motors_at_24_frames_take_half_of_the_start(stage, make_site, tmp_path):
    """A second of the run, by processor time. The start is always the same work: a computer that
    does it in less than two seconds shows eight motors in real time."""
    while worker_seconds():  # from the test before
        time.sleep(ui.LOOK_MS / 1000)
    page = stage.connected(make_site({**try_page.RIG, "motor_count": 8}))
    with jog_up(page, 10):
        started = worker_seconds()
    move = read_move(CAMERA_MOVE)
    columns = [*move.positions.values()] * 2
    rows = [",".join(map(str, row)) for row in zip(range(240), *columns, strict=True)]
    table = tmp_path / "eight.csv"
    table.write_text("\n".join(["frame,1,2,3,4,5,6,7,8", *rows]))
    open_move(page, table)
    prepare_run(page)
    expect(ui.log(page)).to_contain_text("for 8 motors are uploaded")
    first, from_s = frames_played(page, 20), worker_seconds()
    last, to_s = frames_played(page, 180), worker_seconds()
    share = (to_s - from_s) * 24 / (last - first)
    assert 0 < share < 0.65 * started, (share, started)
    expect(ui.log(page)).to_contain_text("Run 0 to 239 is over.")
    assert page.errors == []
