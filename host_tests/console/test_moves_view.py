"""Moves, shots, inputs, outputs and lights in the console."""

import re

import pytest
from playwright.sync_api import expect

from framestep.protocol.messages import RUN_STILLS, RUN_VIDEO
from framestep_tools.client.client import RequestRefused
from framestep_tools.client.wire import FrameDecoder
from framestep_tools.payloads import MotorGetPosition, MotorStatus, RtGo, RtPositionFrame, RtRunMove
from host_tests.console.conftest import PATIENCE_MS
from host_tests.console.looking import (
    HIDE,
    LOOK_MS,
    go_to,
    newest,
    steps,
    wait_connected,
    wait_moving,
    wait_rest,
)

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
    return shared_stage.simulated(rig, motors=2, speed=SPEED)


@pytest.fixture(scope="module")
def opened(shared_stage, device):
    page = shared_stage.page(shared_stage.console(device.url).url)
    wait_connected(page)
    go_to(page, "Moves")
    return page


@pytest.fixture
def page(opened):
    yield opened
    wait_rest(opened)
    assert opened.errors == []


def choose(page, text, name="move.csv"):
    page.get_by_label("Move", exact=True).set_input_files(
        {"name": name, "mimeType": "text/csv", "buffer": text.encode()}
    )


def upload(page, text=MOVE):
    go_to(page, "Moves")
    choose(page, text)
    page.get_by_role("button", name="Upload").click()
    expect(newest(page)).to_contain_text("are uploaded")


def card(page, name):
    return page.get_by_role("article", name=name, exact=True)


def stand(page):
    """Return the positions of all motors, from the view of the motors."""
    go_to(page, "Motors")
    found = [steps(page, 1), steps(page, 2)]
    go_to(page, "Moves")
    return found


def get_ready(page, view, **fields):
    run = card(page, view)
    for label, value in fields.items():
        run.get_by_label(label.replace("_", " "), exact=True).fill(str(value))
    run.get_by_role("button", name="Get ready").click()
    expect(run.get_by_role("status")).to_contain_text("is ready: GO starts it.")
    return run


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
    choose(page, text, "bad.csv")
    expect(newest(page)).to_contain_text(said)
    expect(page.get_by_role("button", name="Upload")).to_be_disabled()


def test_what_spreadsheets_make_of_it_is_read_and_long_moves_go_in_sections(page):
    upload(page, LONG_MOVE)
    expect(page.locator("main")).to_contain_text(f"frames 0 to {LONG - 1} for 1 motor")
    frames = card(page, "Frames")
    frames.get_by_label("Go to frame").fill(str(LONG - 1))
    frames.get_by_role("button", name="Go there").click()
    go_to(page, "Motors")
    expect(page.get_by_label("Position of motor 1 in steps")).to_have_text(str((LONG - 1) % 50))
    go_to(page, "Moves")


def test_a_run_from_upload_to_its_end(page):
    upload(page)
    drawing = page.get_by_role("img", name=f"The move from frame 1 to {FRAMES}")
    expect(drawing.locator("polyline")).to_have_count(2)
    run = get_ready(page, "Run", From_frame=1, To_frame=FRAMES, Frames_per_second=100)
    head = float(drawing.locator("line").get_attribute("x1"))
    run.get_by_role("button", name="GO").click()
    wait_moving(page)
    expect(newest(page)).to_have_text(f"Run 1 to {FRAMES} is over.")
    wait_rest(page)
    assert stand(page) == [10 * FRAMES, -7 * FRAMES]
    assert float(drawing.locator("line").get_attribute("x1")) > head + 100
    expect(page.locator("#moving")).to_contain_text(f"Play head {FRAMES}.000")
    expect(run.get_by_role("button", name="GO")).to_be_disabled()


def test_a_run_that_is_stopped_says_on_which_frame(page):
    upload(page)
    run = get_ready(page, "Run", From_frame=1, To_frame=FRAMES, Frames_per_second=3)
    run.get_by_role("button", name="GO").click()
    expect(page.locator("#moving")).to_contain_text(re.compile(r"Play head ([2-9]|[1-5]\d)\."))
    page.keyboard.press("Escape")
    expect(newest(page)).to_have_text(
        re.compile(rf"Run 1 to {FRAMES} was stopped at frame [1-5]?\d\.\d{{3}}\.")
    )
    wait_rest(page)


def test_a_run_that_is_refused_is_not_prepared(page):
    upload(page)
    run = card(page, "Run")
    run.get_by_label("To frame", exact=True).fill(str(FRAMES + 1))
    run.get_by_role("button", name="Get ready").click()
    expect(newest(page)).to_contain_text("RT_RUN_MOVE was refused with ERR_RANGE")
    expect(run.get_by_role("status")).to_have_text("Nothing is prepared from this page.")


def test_a_run_that_is_too_fast_says_for_which_motor_and_by_how_much(page):
    upload(page, FAST_MOVE)
    run = card(page, "Run")
    run.get_by_label("To frame", exact=True).fill(str(FRAMES))
    run.get_by_label("Frames per second").fill("100")
    run.get_by_role("button", name="Get ready").click()
    expect(newest(page)).to_have_text(
        re.compile(
            r"Refused: motor 1 at frame \d+ would need \d+ steps/s at 100 frames/s,"
            r" its velocity is 5000 steps/s: raise it under Motors, .*"
        )
    )


def runs_asked(page):
    """Return the last RUN_MOVE that the page has sent."""
    frames = FrameDecoder().feed(b"".join(data for data in page.sent if isinstance(data, bytes)))
    return RtRunMove.unpack([f for f in frames if f.type == RtRunMove.TYPE][-1].payload)


def test_camera_and_bloop_go_with_a_run(page, device):
    upload(page)
    run = card(page, "Run")
    run.get_by_label("Camera", exact=True).select_option("stills: a pulse at each frame")
    run.get_by_label("Shutter opens at").fill("45")
    run.get_by_label("Shutter closes at").fill("270")
    run.get_by_label("Bloop output").select_option("output 2")
    run.get_by_label("Bloop DMX channel").fill("7")
    run.get_by_label("Bloop, ms").fill(str(LONG_BLOOP_MS))
    run = get_ready(page, "Run", From_frame=1, To_frame=FRAMES, Frames_per_second=50)
    reported = runs_asked(page)
    assert (reported.flags, reported.open_angle, reported.close_angle) == (RUN_STILLS, 45, 270)
    assert (reported.bloop_outputs, reported.bloop_channel, reported.bloop_ms) == (
        2,
        7,
        LONG_BLOOP_MS,
    )
    run.get_by_role("button", name="GO").click()
    wait_on_board(page, device, lambda hal: hal._levels >> 26 & 1 and hal.dmx.shown[7] == 255)
    expect(newest(page)).to_have_text(f"Run 1 to {FRAMES} is over.")
    wait_rest(page)
    run.get_by_label("Camera", exact=True).select_option("video: a pulse at GO and one at the end")
    expect(run.get_by_label("Shutter opens at")).to_be_hidden()
    run.get_by_label("Bloop output").select_option("none")
    run.get_by_label("Bloop DMX channel").fill("0")
    get_ready(page, "Run")
    reported = runs_asked(page)
    assert (reported.flags, reported.bloop_outputs, reported.bloop_ms) == (RUN_VIDEO, 0, 0)
    run.get_by_label("Bloop, ms").fill("0")
    run.get_by_role("button", name="Get ready").click()
    assert run.get_by_label("Bloop, ms").evaluate("field => !field.validity.valid")
    page.keyboard.press("Escape")
    run.get_by_label("Bloop, ms").fill("100")
    run.get_by_label("Camera", exact=True).select_option("none")


def test_stop_ends_a_loop(page):
    upload(page)
    run = card(page, "Run")
    run.get_by_label("Loop", exact=True).check()
    get_ready(page, "Run", From_frame=1, To_frame=20, Frames_per_second=100)
    run.get_by_role("button", name="GO").click()
    wait_moving(page)
    page.keyboard.press("Escape")
    expect(run.get_by_role("status")).to_have_text("Nothing is prepared from this page.")
    run.get_by_label("Loop", exact=True).uncheck()


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
    frames = card(page, "Frames")
    frames.get_by_label("Go to frame").fill("2")
    frames.get_by_role("button", name="Go there").click()
    expect(page.locator("#moving")).to_contain_text("Nothing moves. Play head 2.000")
    card(page, "Run").get_by_label("To frame", exact=True).fill(str(FRAMES))
    card(page, "Run").get_by_label("Frames per second").fill("2")
    frames.get_by_role("button", name="Jog along the move, forward").hover()
    page.mouse.down()
    expect(page.locator("#moving")).to_contain_text(re.compile(r"Play head ([3-9]|[1-5]\d)\."))
    page.mouse.up()
    wait_rest(page)
    at = int(re.search(r"Play head (\d+)\.000", page.locator("#moving").text_content())[1])
    assert 3 <= at < FRAMES
    assert stand(page) == [10 * at, -7 * at]


def test_a_shot(page):
    upload(page)
    go_to(page, "Motors")
    motor = card(page, "Motor 1")
    motor.locator("summary").click()
    motor.get_by_label("Moves in a shot").check()
    motor.get_by_role("button", name="Set these", exact=True).click()
    expect(newest(page)).to_have_text("Motor 1: on.")
    go_to(page, "Shoot")
    shot = get_ready(page, "Shoot a frame", Frame=10)
    shot.get_by_role("button", name="GO").click()
    expect(newest(page)).to_have_text("The shot of frame 10 is over.")
    wait_rest(page)
    assert stand(page)[0] == 105  # half a frame after frame 10


def on_board(device, look):
    """Return look(hal), called in the board's own thread."""
    found = []
    device.at_board(lambda board: found.append(look(board._board.hal)))
    return found[0]


def wait_on_board(page, device, look):
    for _ in range(PATIENCE_MS // LOOK_MS):
        if on_board(device, look):
            return
        page.wait_for_timeout(LOOK_MS)
    pytest.fail("the board has not done it")


def test_inputs_outputs_and_lights(page, device):
    go_to(page, "Inputs, outputs, lights")
    reported = card(page, "Inputs").get_by_role("status")
    before = reported.nth(1).text_content()
    device.set_pin(28, int(on_board(device, lambda hal: not hal._levels >> 28 & 1)))
    expect(reported.nth(1)).to_have_text("off" if before == "on" else "on")
    card(page, "Outputs").get_by_role("switch", name="Output 2").check()
    wait_on_board(page, device, lambda hal: hal._levels >> 26 & 1 and not hal._levels >> 22 & 1)
    card(page, "Camera").get_by_role("switch", name="Shutter").check()
    wait_on_board(page, device, lambda hal: hal._levels >> hal.board["shutter"] & 1)
    lights = card(page, "Lights")
    lights.get_by_label("From channel").fill("511")
    lights.get_by_label("From channel").press("Enter")
    expect(lights.get_by_role("slider")).to_have_count(2)
    lights.get_by_label("Channel 512").fill("200")
    wait_on_board(page, device, lambda hal: hal.dmx.shown[512] == 200)


def test_a_run_goes_on_without_the_page_only_where_the_user_says_so(stage):
    device = stage.simulated(motors=2, speed=SPEED)
    served = stage.console(device.url)
    ends = []
    for keep in (True, False):
        page = stage.page(served.url)
        wait_connected(page)
        upload(page)
        fps = 60 if keep else ENDLESS_FPS
        get_ready(page, "Run", From_frame=1, To_frame=FRAMES, Frames_per_second=fps)
        if keep:
            page.get_by_label("go on when this page is hidden or closed").check()
        card(page, "Run").get_by_role("button", name="GO").click()
        wait_moving(page)
        page.close()
        with device.client() as client:  # after the server has freed the port
            assert client.request(MotorStatus()).idle
            ends.append(list(client.request(MotorGetPosition()).steps))
    assert ends[0] == [10 * FRAMES, -7 * FRAMES]
    assert ends[1] != ends[0]


def test_a_hidden_page_lets_a_run_go_on_only_where_the_user_says_so(page):
    """In any case it ends a jog."""
    upload(page)
    keep = page.get_by_label("go on when this page is hidden or closed")
    run = get_ready(page, "Run", From_frame=1, To_frame=FRAMES, Frames_per_second=20)
    keep.check()
    run.get_by_role("button", name="GO").click()
    wait_moving(page)
    page.evaluate(HIDE, True)
    expect(newest(page)).to_have_text(f"Run 1 to {FRAMES} is over.")
    page.evaluate(HIDE, False)
    assert stand(page) == [10 * FRAMES, -7 * FRAMES]

    page.get_by_role("navigation").get_by_role("button", name="Motors").click()
    page.get_by_role("button", name="Jog motor 1 up").hover()
    page.mouse.down()
    wait_moving(page)
    page.evaluate(HIDE, True)
    wait_rest(page)
    page.mouse.up()
    page.evaluate(HIDE, False)

    keep.uncheck()
    go_to(page, "Moves")
    run = get_ready(page, "Run", Frames_per_second=ENDLESS_FPS)
    run.get_by_role("button", name="GO").click()
    wait_moving(page)
    page.evaluate(HIDE, True)
    wait_rest(page)
    page.evaluate(HIDE, False)
    assert stand(page) != [10 * FRAMES, -7 * FRAMES]


def test_a_page_that_is_loaded_again_stops_its_run(stage):
    device = stage.simulated(motors=2, speed=SPEED)
    page = stage.page(stage.console(device.url).url)
    wait_connected(page)
    upload(page)
    run = get_ready(page, "Run", From_frame=1, To_frame=FRAMES, Frames_per_second=ENDLESS_FPS)
    run.get_by_role("button", name="GO").click()
    wait_moving(page)
    page.reload()
    wait_connected(page)
    wait_rest(page)
    assert stand(page)[0] < 10 * FRAMES


def test_nothing_of_a_page_is_left_in_the_device(stage):
    """A run that waits for GO ends with its page."""
    device = stage.simulated(motors=2, speed=SPEED)
    page = stage.page(stage.console(device.url).url)
    wait_connected(page)
    upload(page)
    get_ready(page, "Run", From_frame=1, To_frame=FRAMES)
    page.close()
    with device.client() as client:
        client.request(RtPositionFrame(1))
        client.wait_idle()
        with pytest.raises(RequestRefused):
            client.request(RtGo())


def test_moves_uploaded_before_are_at_hand(stage):
    device = stage.simulated(motors=2, speed=SPEED)
    page = stage.page(stage.console(device.url).url)
    wait_connected(page)
    go_to(page, "Moves")
    expect(page.get_by_label("Uploaded before")).to_be_hidden()
    for name, text in (("one.csv", MOVE), ("two.csv", FAST_MOVE), ("one.csv", MOVE)):
        choose(page, text, name)
        page.get_by_role("button", name="Upload").click()
        expect(newest(page)).to_contain_text("are uploaded")
        expect(page.get_by_role("button", name="Upload")).to_be_enabled()
    before = page.get_by_label("Uploaded before")
    names = before.locator("option").all_text_contents()
    assert [name.partition(",")[0] for name in names] == ["choose…", "one.csv", "two.csv"]
    page.reload()
    wait_connected(page)
    go_to(page, "Moves")
    before.select_option(index=2)
    expect(page.locator("main")).to_contain_text(f"two.csv: frames 1 to {FRAMES} for 2 motors")
    page.get_by_role("button", name="Upload").click()
    expect(newest(page)).to_contain_text("are uploaded")
    assert page.errors == []
