"""Constants of the core that framestep.soft_reset repeats, as it does not import the core."""

import re

from framestep_tools.building.board_files import FIRMWARE


def number(file, name):
    """Return a constant of a module; its expression may use the module's other constants."""
    text = (FIRMWARE / "framestep" / file).read_text()
    found = re.search(rf"^{name} = (?:const\()?(.+?)\)?(?:  #.*)?$", text, re.MULTILINE)
    assert found, f"{file} has no {name}"
    return eval(found[1], {})


def test_leftovers_are_looked_for_where_the_port_leaves_its_mark():
    at = number("hal/rp2/usb.py", "_MEMORY") + number("hal/ports/usb_transfers.py", "KEPT_AT")
    assert number("soft_reset.py", "_MARK") == at
    assert number("soft_reset.py", "_ALIVE") == number("hal/ports/usb_transfers.py", "ALIVE")
    assert number("soft_reset.py", "_ADDRESS") == number("hal/rp2/usb.py", "ADDRESS_REGISTER")


def test_pins_that_keep_their_levels_are_noted_behind_what_the_port_keeps():
    kept = 4 * 4  # KEPT_MARK to KEPT_FLAG
    end = (
        number("hal/rp2/usb.py", "_MEMORY") + number("hal/ports/usb_transfers.py", "KEPT_AT") + kept
    )
    for chip in ("chip", "chip_rp2350"):
        assert number(f"hal/rp2/{chip}.py", "KEPT_PINS") == end
