"""The desk as a whole: what is where in each state, size and theme; a take from an empty rig, by
keys and by touch."""

import re

import pytest
from playwright.sync_api import expect

from framestep_tools.client.wire import FrameDecoder
from framestep_tools.console.demo import axes_toml
from framestep_tools.console.demo_board import DemoBoard
from framestep_tools.demo import ROLL_MS
from framestep_tools.judge.judge import judge
from framestep_tools.judge.reference import Reference
from framestep_tools.judge.trace import Trace
from framestep_tools.payloads import RtUploadMoveAxis
from host_tests.console import looking as ui
from host_tests.console.pictures import SIZES, SLOW, SPEED, begun, in_banner, states
from host_tests.selection import sweep

PARTS = ["stop", "go", "ready", "timeline", "rig", "positions", "banner"]
FPS_MILLI = 24_000
# Regions that may not overlap: [name, box] of those that are seen
BOXES = """() => [...document.querySelectorAll(
    '#banner, #tools, #rig, #line, #motors, #stop, #controls, #ready, #go, #pages')]
    .filter((each) => each.checkVisibility())
    .map((each) => [each.id, each.getBoundingClientRect().toJSON()])"""
# Buttons whose text does not fit, or that are outside of the window
CUT = """() => [...document.querySelectorAll('#top button, #line button, #motors button, #transport button')]
    .filter((each) => each.checkVisibility({visibilityProperty: true}))
    .filter((each) => {
        const box = each.getBoundingClientRect();
        return each.scrollWidth > each.clientWidth + 1 || box.right > innerWidth + 1
            || box.left < -1 || box.bottom > innerHeight + 1;
    })
    .map((each) => `${each.id} ${each.textContent}`)"""  # noqa: E501
# Targets smaller than a finger
SMALL = """() => [...document.querySelectorAll('button, input, select')]
    .filter((each) => each.checkVisibility({visibilityProperty: true}) && each.type !== 'checkbox')
    .map((each) => [each, each.getBoundingClientRect()])
    .filter(([, box]) => box.width < 43.5 || box.height < 43.5)
    .map(([each, box]) => `${each.outerHTML.slice(0, 60)} ${box.width} x ${box.height}`)"""
SCROLLS = """() => [document.documentElement, document.querySelector('#rows'), document.querySelector('#chosen')]
    .filter((each) => each.checkVisibility())
    .filter((each) => each.scrollHeight > each.clientHeight + 1 || each.scrollWidth > each.clientWidth + 1)
    .map((each) => each.id || 'page')"""  # noqa: E501


def opened(stage, motors=8, rig=None, **options):
    """Return a page whose motors have positions, and its device."""
    board = {"estop": "no", "name": "desk", **(rig or {})}
    device = stage.simulated(board, motors, SPEED, known=True)
    page = stage.connected(stage.console(device.url).url, **options)
    return page, device


def overlapping(boxes):
    def over(one, other):
        return (
            min(one["right"], other["right"]) - max(one["left"], other["left"]) > 1
            and min(one["bottom"], other["bottom"]) - max(one["top"], other["top"]) > 1
        )

    return [
        (name, other)
        for i, (name, box) in enumerate(boxes)
        for other, there in boxes[i + 1 :]
        if over(box, there)
    ]


def two_keys(page):
    """Make a move of the first motor by K, jog and K."""
    page.keyboard.press("Home")
    page.keyboard.press("k")
    expect(ui.log(page)).to_contain_text("is a keyframe.")
    before = ui.steps(page)
    page.keyboard.down("ArrowRight")
    page.wait_for_timeout(300)
    page.keyboard.up("ArrowRight")
    ui.wait_rest(page)
    assert ui.steps(page) > before
    for _ in range(3):
        page.keyboard.press("End")
        page.wait_for_timeout(150)
    page.keyboard.press("k")
    expect(page.locator("#verdict")).to_be_visible()


def keep_edges(device):
    """Return a list that gets the edges of the board's pins from now on."""
    kept = []

    def begin(board):
        made = board.edges

        def edges():
            found = made()
            kept.extend(found)
            return found

        board.edges = edges

    device.at_board(begin)
    return kept


def uploaded(page):
    """Return the positions of the move that the page has uploaded, {motor: steps}."""
    decoder, found = FrameDecoder(), {}
    for message in page.sent:
        for frame in decoder.feed(message) if isinstance(message, bytes) else ():
            if frame.type == RtUploadMoveAxis.TYPE:
                section = RtUploadMoveAxis.unpack(frame.payload)
                found.setdefault(section.motor, []).extend(section.positions)
    return found


def test_a_take_by_keys_alone_from_an_empty_rig(stage):
    """Pose, key, pose, key, ready, GO; then again. A changed move is uploaded once, and the edges
    are judged as in `make demo`."""
    page, device = opened(stage, motors=2)
    edges = keep_edges(device)
    expect(page.locator("#go")).to_contain_text("no move yet")
    two_keys(page)
    there = ui.steps(page)
    for take in (1, 2):
        page.keyboard.press("r")
        expect(page.locator("#banner")).to_contain_text("READY")
        page.keyboard.press("Space")  # plays the preview; it is no GO
        ui.wait_rest(page)
        expect(page.locator("#banner")).to_contain_text(f"take {take}")
        begun = []
        device.at_board(lambda board, begun=begun: begun.append(board.now_ns))
        page.keyboard.press("Shift+Enter")
        ui.wait_moving(page)
        expect(page.locator("#banner")).to_contain_text("Over")
        assert ui.steps(page) == there
        ui.wait_rest(page)
        move = uploaded(page)
        path = Reference(move, FPS_MILLI, ROLL_MS, ROLL_MS)
        end = {1: there, 2: 0}
        verdict = judge(Trace.from_edges(edges), move, FPS_MILLI, {}, end, path, begun[0])
        assert verdict.good, verdict.complaints
        assert len(verdict.motors[0].edge_times_s) >= there - 1
    uploads = [said for said in ui.log(page).locator("p").all_text_contents() if "uploaded" in said]
    assert len(uploads) == 1
    ui.go_to(page, "Log")
    expect(page.get_by_role("row", name="1 Run")).to_contain_text("complete")
    assert page.errors == []


# Draws the page next as a text comes into its log, not before
DRAW_AT = """text => {
    const held = [], draw = window.requestAnimationFrame;
    window.requestAnimationFrame = (callback) => held.push(callback);
    new MutationObserver((_, seen) => {
        if (!document.querySelector('#log').textContent.includes(text)) return;
        seen.disconnect();
        window.requestAnimationFrame = draw;
        for (const callback of held.splice(0)) callback(performance.now());
    }).observe(document.querySelector('#log'), {childList: true, subtree: true, characterData: true});
}"""  # noqa: E501


def test_a_run_that_is_stopped_before_it_is_drawn(stage):
    """As on a busy computer: what moves at its end is no new motion, after which it is over."""
    page, _ = opened(stage, motors=2)
    two_keys(page)
    page.locator("#ready").click()
    in_banner(page, "READY")
    page.evaluate(DRAW_AT, "was stopped at frame")
    page.keyboard.press("Shift+Enter")
    page.wait_for_timeout(500)
    page.keyboard.press("Escape")
    in_banner(page, "Stopped")
    ui.wait_rest(page)
    in_banner(page, "by: STOP on this page")
    assert page.errors == []


@pytest.mark.parametrize("keep", [False, True], ids=["alone", "goes on"])
def test_the_link_is_lost_in_a_run(stage, keep):
    """The page does not know how it ends, and says so; STOP is sent once the link is back."""
    device = stage.simulated({"estop": "no"}, 2, known=True)
    console = stage.console(device.url)
    page = stage.connected(console.url)
    two_keys(page)
    if keep:
        ui.go_to(page, "Options")
        page.get_by_label("Runs and moves go on").check()
        ui.close_drawer(page)
    page.locator("#ready").click()
    in_banner(page, "READY")
    page.locator("#go").click()
    in_banner(page, "Take 1 runs")

    async def cut():
        console.server._visit._page.transport.abort()

    console.call(cut())
    expect(page.get_by_role("alert")).to_contain_text("Whether motors move is NOT KNOWN")
    expect(page.locator("#count")).not_to_have_text(re.compile(r"\d$"))
    expect(page.locator("#stop")).to_be_enabled()
    if keep:
        page.locator("#stop").click()
        expect(ui.log(page)).to_contain_text("Stopped: all motors ramp down.")
    lost = "the link has ended since GO, so whether it goes on or has ended is not known."
    expect(ui.log(page)).to_contain_text(lost)
    ui.wait_rest(page)
    if not keep:
        in_banner(page, lost)
    assert page.errors == []


def test_dragging_the_preview_sends_nothing_that_moves(stage):
    page, _ = opened(stage, motors=2)
    two_keys(page)
    page.keyboard.press("Home")
    before = [ui.steps(page, n) for n in (1, 2)]
    box = page.locator("#curves").bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 30)
    page.mouse.down()
    page.mouse.move(box["x"] + 400, box["y"] + 30, steps=5)
    page.mouse.up()
    expect(page.locator("#send b")).not_to_have_text("1")
    ui.wait_rest(page)
    assert [ui.steps(page, n) for n in (1, 2)] == before


# The second square is above this place
HIGHER = "y => document.querySelectorAll('#curves [data-pose]')[1].getBoundingClientRect().y < y"
# A finger on the time line
TOUCH = """events => {
    const line = document.querySelector('#curves');
    line.setPointerCapture = () => {};
    for (const [kind, clientX, clientY] of events) {
        line.dispatchEvent(new PointerEvent(kind, {pointerType: 'touch', button: 0, clientX, clientY, bubbles: true}));
    }
}"""  # noqa: E501


@pytest.mark.parametrize("size", sweep(SIZES, (390, 844)), ids=str)
def test_each_state_keeps_its_places(stage, size):
    """No overlap and no scrolling; no region moves; axe-core finds nothing. Every second size is
    dark, a desk's and a phone's."""
    theme = ("light", "dark")[SIZES.index(size) % 2]
    touch = size[0] < 1000
    page, device = begun(stage, size, theme)
    page.evaluate(ui.AXE.read_text())
    places = None
    for state, shown in states(stage, page, device):
        boxes = shown.evaluate(BOXES)
        assert overlapping(boxes) == [], state
        assert shown.evaluate(SCROLLS) == [], state
        assert shown.evaluate(CUT) == [], state
        assert places in (None, boxes), state
        places = boxes
        expect(shown.locator("#stop")).to_be_enabled()
        if state == "not connected":  # loaded again
            shown.evaluate(ui.AXE.read_text())
        assert shown.evaluate(ui.FINDINGS) == [], state
    for part in PARTS:
        assert page.locator(f'[data-part="{part}"]').count() == 1, part
    if touch:
        for name in ("jog", "move", "take"):
            page.locator(f'[data-page="{name}"]').click()
            assert overlapping(page.evaluate(BOXES)) == [], name
            assert page.evaluate(SMALL) == [], name
            assert page.evaluate(ui.FINDINGS) == [], name


def test_a_finger_bends_a_curve_without_meeting_its_mark_exactly(stage):
    device = stage.simulated({"estop": "no"}, 8, SPEED)
    page = stage.page(
        stage.console(device.url).url, viewport={"width": 390, "height": 844}, has_touch=True
    )
    page.evaluate("text => localStorage.setItem('keyframes', text)", SLOW)
    page.reload()
    ui.wait_connected(page)
    page.locator('[data-page="move"]').tap()
    square = page.locator("#curves [data-pose]").nth(1)
    before = square.bounding_box()
    x, y = before["x"] + 7 + 14, before["y"] + 7 + 14  # 20 px beside its middle
    events = [("pointerdown", y), ("pointermove", y - 40), ("pointerup", y - 40)]
    page.evaluate(TOUCH, [[kind, x, at] for kind, at in events])
    expect(page.locator("#undo")).to_be_enabled()
    page.wait_for_function(HIGHER, arg=before["y"] - 20)
    assert page.errors == []


def test_twelve_motors_fit(stage):
    page, _ = opened(stage, motors=12, viewport={"width": 1280, "height": 800})
    expect(page.locator("#rows li")).to_have_count(12)
    assert page.evaluate(SCROLLS) == []
    last = page.locator("#rows li").last.bounding_box()
    stop = page.locator("#stop").bounding_box()
    go = page.locator("#go").bounding_box()
    assert last["y"] + last["height"] < stop["y"]
    assert go["width"] * go["height"] > 0.9 * stop["width"] * stop["height"]


def test_no_drawer_covers_stop_go_or_the_banner(stage):
    page, _ = opened(stage, viewport={"width": 1280, "height": 800})
    for view in [*ui.DRAWERS, *ui.SET_UP]:
        ui.go_to(page, view)
        drawer = page.locator("#drawer").bounding_box()
        for part in ("banner", "stop", "ready", "go"):
            box = page.locator(f'[data-part="{part}"]').bounding_box()
            below = box["y"] >= drawer["y"] + drawer["height"] - 1
            assert below or box["y"] + box["height"] <= drawer["y"] + 1, (view, part)
    ui.close_drawer(page)
    page.keyboard.press("?")
    expect(page.locator("#d-title")).to_have_text("Keys")


@pytest.fixture
def demo(stage, tmp_path):
    """Return the page of `framestep console --demo`."""
    board = DemoBoard(SPEED)
    stage.closing(board.close)
    axes = tmp_path / "axes.toml"
    axes.write_text(axes_toml())
    served = stage.console(board.url, axes=axes)
    served.server.device.simulate(board)
    page = stage.page(served.url, viewport={"width": 1280, "height": 800})
    ui.wait_connected(page, "Position of track in mm")
    return page


def test_the_demo_is_a_crane_with_a_tour(demo):
    """Its six steps, in order, as a user does them."""
    page = demo
    expect(page.locator("#rows li")).to_have_count(8)
    expect(page.locator("#verdict")).to_have_text("✓ fits")
    expect(page.locator("#pose")).to_contain_text("Camera X")
    assert page.evaluate(CUT) == []
    tour = page.get_by_role("article", name="Tour")

    def done(step):
        expect(tour.locator("li").nth(step)).to_have_class("done")

    with ui.held(page, "Jog track up"):
        page.wait_for_timeout(300)
    done(0)
    page.get_by_role("button", name="Zero here").locator("visible=true").click()
    done(1)
    tour.get_by_role("button", name="Show me where").locator("visible=true").click()
    expect(page.locator("#curves")).to_have_class("marked")
    page.keyboard.press("End")
    done(2)
    page.locator("#ready").click()
    expect(page.locator("#banner")).to_contain_text("READY")
    page.locator("#go").click()
    expect(page.locator("#banner")).to_contain_text("Over")
    done(3)
    page.locator("#ready").click()
    expect(page.locator("#banner")).to_contain_text("READY")
    page.locator("#go").click()
    ui.wait_moving(page)
    estop = page.get_by_role("button", name="E-stop", exact=True)
    estop.click()
    expect(page.locator("#banner")).to_contain_text("E-STOP")
    ui.wait_rest(page)
    estop.click()
    expect(page.locator("#banner")).not_to_contain_text("E-STOP")
    done(4)
    tour.get_by_role("button", name="Type it for me").click()
    expect(page.locator(".xterm-rows")).to_contain_text("motor 8")
    done(5)
    expect(tour.get_by_role("status")).to_contain_text("That was the tour")
    page.get_by_role("button", name="Close the tour").click()
    expect(tour).to_be_hidden()
    assert page.errors == []


def test_a_take_by_touch(stage):
    """A thumb starts nothing outside of the page Take; a jog lasts as long as the finger."""
    page, _ = opened(stage, motors=2, viewport={"width": 390, "height": 844}, has_touch=True)
    page.locator('[data-page="jog"]').tap()
    expect(page.locator("#go")).to_contain_text("under Take")
    page.locator('[data-page="move"]').tap()
    page.locator("#keyhere").tap()
    page.locator('[data-page="jog"]').tap()
    up = ui.motor(page, "Motor 1").get_by_role("button", name="Jog motor 1 up")
    up.dispatch_event("pointerdown", {"pointerId": 1, "button": 0, "isPrimary": True})
    ui.wait_moving(page)
    page.wait_for_timeout(300)
    up.dispatch_event("pointerup", {"pointerId": 1})
    ui.wait_rest(page)
    page.locator('[data-page="move"]').tap()
    box = page.locator("#curves").bounding_box()
    page.locator("#curves").tap(position={"x": box["width"] - 60, "y": 30})
    page.locator("#keyhere").tap()
    page.locator('[data-page="take"]').tap()
    page.locator("#ready").tap()
    expect(page.locator("#banner")).to_contain_text("READY")
    page.locator("#go").tap()
    ui.wait_moving(page)
    expect(page.locator("#banner")).to_contain_text("Over")
    assert page.errors == []
