"""Moves, shots, inputs, outputs and lights in the console."""

import re

import pytest
from playwright.sync_api import expect

from framestep.protocol.messages import RUN_STILLS, RUN_VIDEO
from framestep_tools import payloads as p
from framestep_tools.client.client import RequestRefused
from framestep_tools.client.wire import FrameDecoder
from host_tests.console import looking as ui
from host_tests.console.conftest import PATIENCE_MS

FRAMES = 60
SPEED = 3.0  # times real time: no test holds anything but a jog that may end anywhere
MOVE = "frame,slide,pan\n" + "".join(f"{n},{10 * n},{-7 * n}\n" for n in range(1, FRAMES + 1))
FAST_MOVE = "frame,slide,pan\n" + "".join(f"{n},{100 * n},0\n" for n in range(1, FRAMES + 1))
ENDLESS_FPS = 1  # a run that has not ended by itself, also on a busy computer
LONG = 3000
LONG_BLOOP_MS = 30_000  # time to look, also on a busy computer
# It needs several sections for each motor
LONG_MOVE = "frame;a\r\n" + "".join(f"{n};{n % 50}\r\n" for n in range(LONG)) + ";\r\n"


@pytest.fixture(scope="module")
def device(shared_stage):
    rig = {"outputs": [{"pin": 22}, {"pin": 26}], "inputs": [{"pin": 27}, {"pin": 28}]}
    return shared_stage.simulated(rig, motors=2, speed=SPEED, known=True)


@pytest.fixture(scope="module")
def opened(shared_stage, device):
    page = shared_stage.connected(shared_stage.console(device.url).url)
    return page


def choose(page, text, name="move.csv"):
    ui.go_to(page, "Move")
    ui.open_move(page, name, text)
    ui.close_drawer(page)


def upload(page, text=MOVE):
    """Open a move and send the rig to its first frame, which uploads it unless the board has it."""
    choose(page, text)
    expect(page.locator("#file")).to_contain_text("move.csv")
    send(page, int(text.splitlines()[1].replace(";", ",").split(",")[0]))


def send(page, frame):
    """Send the rig to a frame by way of the preview."""
    page.locator("#curves").click(position={"x": 300, "y": 40})  # no field has the focus then
    page.locator("#transport").get_by_role("button", name="Run", exact=True).focus()
    page.keyboard.press("Home")
    ui.wait_drawn(page)
    for _ in range(frame - int(page.locator("#send b").text_content())):
        page.keyboard.press(".")
    expect(page.locator("#send b")).to_have_text(str(frame))
    page.locator("#send").click()
    expect(page.locator("#moving")).to_contain_text(f"Nothing moves. Play head {frame}.000")


def value(page, label):
    """Return the field of the transport with this name, of the mode that is shown."""
    return page.locator(f'#fields [aria-label="{label}"]:visible')


def stand(page):
    """Return the positions of all motors."""
    return [ui.steps(page, 1), ui.steps(page, 2)]


def wait_stand(page, *positions):
    """Wait until the page shows these positions: it tells an end before it draws them."""
    for motor, steps_there in enumerate(positions, 1):
        expect(ui.position(page, motor)).to_have_text(str(steps_there))


def get_ready(page, **fields):
    for label, given in fields.items():
        value(page, label.replace("_", " ")).fill(str(given))
    page.locator("#ready").click()
    expect(page.locator("#banner")).to_contain_text("READY")


def go(page):
    page.locator("#go").click()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "bad.csv, line 1: expected the header frame,<motor 1>,<motor 2>…"),
        ("frames,a\n1,2\n", "line 1: expected the header"),
        ("frame,a\n", "bad.csv: expected a line for each frame, found none"),
        ("frame,a\n1,2\n3,4\n", "line 3: expected frame 2, found 3"),
        ("frame,a\n1,2,3\n", "line 2: expected 2 whole numbers, found “1,2,3”"),
        ("frame,a\n1,2.5\n", "line 2: expected a whole number for a, found “2.5”"),
        ("frame,a\n1,2147483648\n", "line 2: positions have to fit 32 bits signed"),
    ],
)
def test_a_file_that_is_no_move(page, text, said):
    before = page.locator("#file").text_content()
    choose(page, text, "bad.csv")
    expect(ui.newest(page)).to_contain_text(said)
    assert page.locator("#file").text_content() == before


def test_what_spreadsheets_make_of_it_is_read_and_long_moves_go_in_sections(page):
    upload(page, LONG_MOVE)
    ui.go_to(page, "Move")
    expect(page.locator("main")).to_contain_text(f"frames 0 to {LONG - 1} for 1 motor")
    ui.close_drawer(page)
    page.keyboard.press("End")
    page.locator("#send").click()
    expect(page.get_by_label("Position of motor 1 in steps")).to_have_text(str((LONG - 1) % 50))


def test_a_run_from_upload_to_its_end(page):
    """Get ready uploads what is new, and only that."""
    choose(page, MOVE)
    drawing = page.get_by_role("img", name=f"The move from frame 1 to {FRAMES}")
    expect(drawing.locator("polyline.curve")).to_have_count(3)  # two curves and a speed
    expect(page.locator("#file-is")).to_contain_text(re.compile("not uploaded|changed"))
    get_ready(page, From_frame=1, To_frame=FRAMES, Frames_per_second=100)
    expect(page.locator("#file-is")).to_contain_text("frames, uploaded")
    head = page.locator(".head-rig")
    before = head.get_attribute("transform")
    go(page)
    ui.wait_moving(page)
    expect(ui.newest(page)).to_have_text(f"Run 1 to {FRAMES} is over.")
    ui.wait_rest(page)
    wait_stand(page, 10 * FRAMES, -7 * FRAMES)
    assert head.get_attribute("transform") != before
    expect(page.locator("#moving")).to_contain_text(f"Play head {FRAMES}.000")
    expect(page.locator("#banner")).to_contain_text("Over")
    expect(page.locator("#go")).to_be_disabled()
    page.sent.clear()
    get_ready(page)
    sent = FrameDecoder().feed(b"".join(data for data in page.sent if isinstance(data, bytes)))
    assert p.RtRunMove.TYPE in {frame.type for frame in sent}
    assert p.RtUploadMoveBegin.TYPE not in {frame.type for frame in sent}
    page.keyboard.press("Escape")


def test_a_run_that_is_stopped_says_on_which_frame(page):
    choose(page, MOVE)
    get_ready(page, From_frame=1, To_frame=FRAMES, Frames_per_second=3)
    go(page)
    expect(page.locator("#moving")).to_contain_text(re.compile(r"Play head ([2-9]|[1-5]\d)\."))
    page.keyboard.press("Escape")
    expect(ui.newest(page)).to_have_text(
        re.compile(rf"Run 1 to {FRAMES} was stopped at frame [1-5]?\d\.\d{{3}}\.")
    )
    ui.wait_rest(page)
    expect(page.locator("#banner")).to_contain_text("by: STOP on this page")


def test_a_run_that_is_refused_is_not_prepared(page):
    choose(page, MOVE)
    value(page, "To frame").fill(str(FRAMES + 1))
    page.locator("#ready").click()
    expect(ui.newest(page)).to_contain_text("RT_RUN_MOVE was refused with ERR_RANGE")
    expect(page.locator("#banner")).to_contain_text("Refused")
    expect(page.locator("#go")).to_be_disabled()


def test_a_run_that_is_too_fast_says_for_which_motor_and_by_how_much(page):
    """It is marked on the curve; a button sets what it needs, then the run is prepared."""
    choose(page, FAST_MOVE)
    fps = value(page, "Frames per second")
    fps.fill("100")
    fps.press("Tab")
    expect(page.locator("#verdict")).to_have_text("✗ 1 does not fit")
    expect(page.locator("#curves circle.misfit").first).to_be_visible()
    expect(page.locator("#curves .said")).to_contain_text("needs 10000 steps/s, set 5000 steps/s")
    page.locator("#ready").click()
    expect(ui.newest(page)).to_have_text(
        re.compile(
            r"Refused: motor 1 at frame \d+ would need \d+ steps/s at 100 frames/s,"
            r" its velocity is 5000 steps/s: raise it in the motor's settings, .*"
        )
    )
    page.get_by_role("button", name="Raise Motor 1's speed").or_(
        page.get_by_role("button", name="Raise motor 1's speed")
    ).click()
    expect(ui.newest(page)).to_contain_text("Speeds are set: motor 1 11000 steps/s")
    expect(page.locator("#verdict")).to_have_text("✓ fits")


def runs_asked(page):
    """Return the last RUN_MOVE that the page has sent."""
    frames = FrameDecoder().feed(b"".join(data for data in page.sent if isinstance(data, bytes)))
    return p.RtRunMove.unpack([f for f in frames if f.type == p.RtRunMove.TYPE][-1].payload)


def test_camera_and_bloop_go_with_a_run(page, device):
    choose(page, MOVE)
    ui.go_to(page, "Options")
    run = page.locator("#drawer")
    run.get_by_role("combobox", name="Camera").select_option("stills: a pulse at each frame")
    run.get_by_label("Shutter opens at").fill("45")
    run.get_by_label("Shutter closes at").fill("270")
    run.get_by_label("Bloop output").select_option("output 2")
    run.get_by_label("Bloop DMX channel").fill("7")
    run.get_by_label("Bloop, ms").fill(str(LONG_BLOOP_MS))
    get_ready(page, From_frame=1, To_frame=FRAMES, Frames_per_second=50)
    reported = runs_asked(page)
    assert (reported.flags, reported.open_angle, reported.close_angle) == (RUN_STILLS, 45, 270)
    bloop = reported.bloop_outputs, reported.bloop_channel, reported.bloop_ms
    assert bloop == (2, 7, LONG_BLOOP_MS)
    go(page)
    wait_on_board(page, device, lambda hal: hal._levels >> 26 & 1 and hal.dmx.shown[7] == 255)
    expect(ui.newest(page)).to_have_text(f"Run 1 to {FRAMES} is over.")
    ui.wait_rest(page)
    run.get_by_role("combobox", name="Camera").select_option(
        "video: a pulse at GO and one at the end"
    )
    expect(run.get_by_label("Shutter opens at")).to_be_hidden()
    run.get_by_label("Bloop output").select_option("none")
    run.get_by_label("Bloop DMX channel").fill("0")
    get_ready(page)
    reported = runs_asked(page)
    assert (reported.flags, reported.bloop_outputs, reported.bloop_ms) == (RUN_VIDEO, 0, 0)
    page.keyboard.press("Escape")
    run.get_by_label("Bloop, ms").fill("0")
    page.locator("#ready").click()
    assert run.get_by_label("Bloop, ms").evaluate("field => !field.validity.valid")
    run.get_by_label("Bloop, ms").fill("100")
    run.get_by_role("combobox", name="Camera").select_option("none")
    ui.close_drawer(page)


def test_stop_ends_a_loop(page):
    choose(page, MOVE)
    loop = value(page, "Loop")
    loop.select_option("loop")
    get_ready(page, From_frame=1, To_frame=20, Frames_per_second=100)
    go(page)
    ui.wait_moving(page)
    expect(page.locator("#ready")).to_contain_text("Last lap")
    page.keyboard.press("Escape")
    expect(page.locator("#banner")).to_contain_text("Stopped")
    loop.select_option("off")


# An operation or a series with a fake device, which takes every request. `given` is what happens.
OPERATION = """async (given) => {
    const { Operation } = await import('/operation.js');
    const { Series } = await import('/series.js');
    const said = [];
    const device = Object.assign(new EventTarget(), {
        state: { moving: 0, playHead: 5000 },
        connected: true, silent: false, knowsWhatMoves: true,
        tell(text) { said.push(text); },
        async ask(request) { return !(this.refuses ?? []).includes(request); },
        async seeWhatMoves() {},
    });
    const happen = (name) => device.dispatchEvent(new Event(name));
    const operation = new Operation(device);
    const begin = async (options) => {
        await operation.prepare('Run 1 to 9', 'RtRunMove', {}, options);
        happen('change');
        await operation.go();
    };
    const lose = () => {
        device.connected = false;
        happen('gone');
    };
    const shoot = async () => {
        const series = new Series(device, operation);
        const shots = series.shoot([4, 5, 6], 0, () => ({}));
        const step = () => new Promise((done) => setTimeout(done));
        for (let shot = 0; shot < 2; shot += 1) {
            while (!operation.playing) {
                happen('change');
                await step();
            }
            if (shot === 0) happen('ended');
        }
        lose();
        await shots;
    };
    await ({
        ended: async () => { await begin({ last: 5 }); happen('ended'); },
        early: async () => { await begin({ last: 9 }); happen('ended'); },
        loop: async () => { await begin({ loops: true }); happen('ended'); },
        ended_loop: async () => {
            await begin({ loops: true });
            await operation.endLoop();
            happen('ended');
        },
        loop_that_goes_on: async () => {
            await begin({ loops: true });
            device.refuses = ['RtStopLoop'];
            await operation.endLoop();
            happen('ended');
        },
        lost: async () => { await begin({ last: 9 }); lose(); },
        lost_with_go: async () => {
            device.ask = async (request) => request !== 'RtGo' || (lose(), null);
            await begin({ last: 9 });
        },
        ready: async () => { await operation.prepare('Run 1 to 9', 'RtRunMove', {}); lose(); },
        silent: async () => { await begin({ last: 9 }); device.silent = true; },
        series: shoot,
    })[given]();
    return [...said, operation.text];
}"""
NOTHING = "Nothing is prepared from this page."
UNKNOWN = (
    "Run 1 to 9: the link has ended since GO, so whether it goes on or has ended is not known."
)
STOPPED = "Run 1 to 9 was stopped at frame 5.000."


def test_what_is_not_known_of_a_run_is_not_said(page):
    shot = UNKNOWN.replace("Run 1 to 9", "The shot of frame 5")
    for happens, said in {
        "ended": ["Run 1 to 9 is over.", NOTHING],
        "early": [STOPPED, NOTHING],
        "loop": [STOPPED, NOTHING],
        "ended_loop": ["Run 1 to 9 is over.", NOTHING],
        "loop_that_goes_on": [STOPPED, NOTHING],
        "lost": [UNKNOWN, UNKNOWN],
        "lost_with_go": [UNKNOWN, UNKNOWN],
        "ready": [NOTHING],
        "silent": ["Run 1 to 9: the device does not answer, so whether it goes on is not known."],
        "series": [
            "The shot of frame 4 is over.",
            shot,
            "Whether frame 5 is shot is not known. Frames 4 to 4 are shot;"
            " 1 are not, from frame 6 on.",
            shot,
        ],
    }.items():
        assert page.evaluate(OPERATION, happens) == said, happens


def test_a_jog_along_the_move_lasts_as_long_as_it_is_held(page):
    upload(page)
    send(page, 2)
    value(page, "Frames per second").fill("2")
    with ui.held(page, "Jog the rig along the move, forward"):
        expect(page.locator("#moving")).to_contain_text(re.compile(r"Play head ([3-9]|[1-5]\d)\."))
    at_rest = re.compile(r"Nothing moves\. Play head (\d+)\.000")
    expect(page.locator("#moving")).to_contain_text(at_rest)
    at = int(at_rest.search(page.locator("#moving").text_content())[1])
    assert 3 <= at < FRAMES
    wait_stand(page, 10 * at, -7 * at)


def test_a_shot(page):
    """One press goes to where it begins, and shoots; frames that are shot stay marked."""
    upload(page)
    motor = ui.settings(page, "Motor 1")
    motor.get_by_label("Moves in a shot").check()
    motor.get_by_role("button", name="Set these", exact=True).click()
    expect(ui.newest(page)).to_have_text("Motor 1: on.")
    ui.close_drawer(page)
    page.get_by_role("button", name="Frames", exact=True).click()
    value(page, "Frame").fill("10")
    page.locator("#go").click()
    expect(ui.newest(page)).to_have_text("The shot of frame 10 is over.")
    ui.wait_rest(page)
    wait_stand(page, 105)  # half a frame after frame 10
    expect(page.locator("#curves .shot")).to_have_count(1)
    page.get_by_role("button", name="Next frame").click()
    expect(page.locator("#moving")).to_contain_text("Nothing moves. Play head 11.000")
    page.get_by_role("button", name="Run", exact=True).click()


def on_board(device, look):
    """Return look(hal), called in the board's own thread."""
    found = []
    device.at_board(lambda board: found.append(look(board._board.hal)))
    return found[0]


def wait_on_board(page, device, look):
    for _ in range(PATIENCE_MS // ui.LOOK_MS):
        if on_board(device, look):
            return
        page.wait_for_timeout(ui.LOOK_MS)
    pytest.fail("the board has not done it")


def test_inputs_outputs_and_lights(page, device):
    ui.go_to(page, "Lights")
    reported = ui.card(page, "Inputs").get_by_role("status")
    expect(reported.nth(1)).to_have_text(re.compile("^(on|off)$"))
    before = reported.nth(1).text_content()
    device.set_pin(28, int(on_board(device, lambda hal: not hal._levels >> 28 & 1)))
    expect(reported.nth(1)).to_have_text("off" if before == "on" else "on")
    ui.card(page, "Outputs").get_by_role("switch", name="Output 2").check()
    wait_on_board(page, device, lambda hal: hal._levels >> 26 & 1 and not hal._levels >> 22 & 1)
    ui.card(page, "Camera").get_by_role("switch", name="Shutter").check()
    wait_on_board(page, device, lambda hal: hal._levels >> hal.board["shutter"] & 1)
    lights = ui.card(page, "Lights")
    lights.get_by_label("From channel").fill("511")
    lights.get_by_label("From channel").press("Enter")
    expect(lights.get_by_role("slider")).to_have_count(2)
    lights.get_by_label("Channel 512").fill("200")
    wait_on_board(page, device, lambda hal: hal.dmx.shown[512] == 200)
    ui.close_drawer(page)


def test_a_run_goes_on_without_the_page_only_where_the_user_says_so(stage):
    device = stage.simulated(motors=2, speed=SPEED, known=True)
    served = stage.console(device.url)
    ends = []
    for keep in (True, False):
        page = stage.connected(served.url)
        choose(page, MOVE)
        fps = 60 if keep else ENDLESS_FPS
        get_ready(page, From_frame=1, To_frame=FRAMES, Frames_per_second=fps)
        if keep:
            ui.go_to(page, "Options")
            page.get_by_label("go on when this page is hidden or closed").check()
        go(page)
        ui.wait_moving(page)
        page.close()
        with device.client() as client:  # after the server has freed the port
            assert client.request(p.MotorStatus()).idle
            ends.append(list(client.request(p.MotorGetPosition()).steps))
    assert ends[0] == [10 * FRAMES, -7 * FRAMES]
    assert ends[1] != ends[0]


def test_a_hidden_page_lets_a_run_go_on_only_where_the_user_says_so(page):
    """In any case it ends a jog."""
    choose(page, MOVE)
    keep = page.get_by_label("go on when this page is hidden or closed")
    get_ready(page, From_frame=1, To_frame=FRAMES, Frames_per_second=20)
    ui.go_to(page, "Options")
    keep.check()
    go(page)
    ui.wait_moving(page)
    page.evaluate(ui.HIDE, True)
    expect(ui.newest(page)).to_have_text(f"Run 1 to {FRAMES} is over.")
    page.evaluate(ui.HIDE, False)
    wait_stand(page, 10 * FRAMES, -7 * FRAMES)

    ui.close_drawer(page)
    with ui.held(page, "Jog motor 1 up"):
        ui.wait_moving(page)
        page.evaluate(ui.HIDE, True)
        ui.wait_rest(page)
    page.evaluate(ui.HIDE, False)

    ui.go_to(page, "Options")
    keep.uncheck()
    get_ready(page, Frames_per_second=ENDLESS_FPS)
    go(page)
    ui.wait_moving(page)
    page.evaluate(ui.HIDE, True)
    ui.wait_rest(page)
    page.evaluate(ui.HIDE, False)
    ui.close_drawer(page)
    assert stand(page) != [10 * FRAMES, -7 * FRAMES]


def test_a_page_that_is_loaded_again_stops_its_run(stage):
    page, _ = stage.opened(motors=2, speed=SPEED, known=True)
    choose(page, MOVE)
    get_ready(page, From_frame=1, To_frame=FRAMES, Frames_per_second=ENDLESS_FPS)
    go(page)
    ui.wait_moving(page)
    page.reload()
    ui.wait_connected(page)
    ui.wait_rest(page)
    assert stand(page)[0] < 10 * FRAMES


def test_nothing_of_a_page_is_left_in_the_device(stage):
    """A run that waits for GO ends with its page."""
    page, device = stage.opened(motors=2, speed=SPEED, known=True)
    choose(page, MOVE)
    get_ready(page, From_frame=1, To_frame=FRAMES)
    page.close()
    with device.client() as client:
        client.request(p.RtPositionFrame(1))
        client.wait_idle()
        with pytest.raises(RequestRefused):
            client.request(p.RtGo())


def test_moves_used_before_are_at_hand(stage):
    page, _ = stage.opened(motors=2, speed=SPEED, known=True)
    ui.go_to(page, "Move")
    before = page.get_by_label("Used before")
    expect(before).to_be_hidden()
    for name, text in (("one.csv", MOVE), ("two.csv", FAST_MOVE), ("one.csv", MOVE)):
        choose(page, text, name)
        expect(page.locator("#file-name")).to_have_text(name)
    names = before.locator("option").all_text_contents()
    assert [name.partition(",")[0] for name in names] == ["choose…", "one.csv", "two.csv"]
    page.reload()
    ui.wait_connected(page)
    expect(page.locator("#file-name")).to_have_text("one.csv")  # what was on the desk
    ui.go_to(page, "Move")
    before.select_option(index=2)
    expect(page.locator("main")).to_contain_text(f"two.csv: frames 1 to {FRAMES} for 2 motors")
    ui.close_drawer(page)
    get_ready(page)
    assert page.errors == []
