"""The console before the emulated board: what only the firmware itself and its REPL can show."""

import json

from playwright.sync_api import expect

from framestep_tools.boards import EmulatedBoard
from framestep_tools.console.board_work import BoardWork
from host_tests.console.conftest import Device
from host_tests.console.looking import (
    go_to,
    log,
    steps,
    wait_connected,
    wait_far,
    wait_moving,
    wait_rest,
)


def test_a_jog_the_load_and_a_new_rig_file(stage):
    board = EmulatedBoard({"name": "before"}, trace=False)
    device = Device(board, 1.0, repl=True)
    stage.closing(device.close)
    page = stage.page(stage.console(device.url, BoardWork(device.repl, device.url)).url)
    wait_connected(page)

    page.keyboard.down("ArrowLeft")
    wait_moving(page)
    wait_far(page, 1, 0, 100)
    page.keyboard.up("ArrowLeft")
    wait_rest(page)
    assert steps(page) < -100

    go_to(page, "Rig file, load")
    page.get_by_role("button", name="Measure").click()
    load = page.get_by_role("article", name="Load of the board").get_by_role("status")
    expect(load).to_contain_text("us in a tick of 1000 on average")

    rig = page.get_by_role("article", name="Rig file of the board")
    rig.get_by_role("button", name="Read").click()
    expect(rig.get_by_role("status")).to_have_text("As it is on the board.")
    text = rig.get_by_label("Rig file")
    assert json.loads(text.input_value()) == {"name": "before"}
    text.fill('{"name": "after", "motor_count": 99}')
    rig.get_by_role("button", name="Put onto the board").click()
    expect(rig.get_by_role("status")).to_contain_text("motor_count")
    text.fill('{"name": "after", // a comment\n "motor_count": 3}')
    rig.get_by_role("button", name="Check").click()
    expect(rig.get_by_role("status")).to_contain_text("right for Raspberry Pi Pico: 'after'")
    rig.get_by_role("button", name="Put onto the board").click()
    expect(rig.get_by_role("status")).to_contain_text("after on socket://")
    expect(page.locator("#who")).to_contain_text("after, firmware")
    go_to(page, "Motors")
    expect(page.get_by_role("article")).to_have_count(3)
    rig_text = log(page).text_content()
    assert "motor_count" in rig_text  # the mistake was told beside the file, too
