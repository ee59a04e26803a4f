"""What framestep.leftovers knows of the core without importing it."""

import re

from framestep_tools.building.board_files import FIRMWARE


def number(file, name):
    """A constant of a module, of which others may make use in it."""
    text = (FIRMWARE / "framestep" / file).read_text()
    found = re.search(rf"^{name} = (?:const\()?(.+?)\)?(?:  #.*)?$", text, re.MULTILINE)
    assert found, f"{file} has no {name}"
    return eval(found[1], {})


def test_leftovers_are_looked_for_where_the_port_leaves_its_mark():
    at = number("hal/rp2/usb.py", "_MEMORY") + number("hal/ports/usb_transfers.py", "KEPT_AT")
    assert number("leftovers.py", "_MARK") == at
    assert number("leftovers.py", "_ALIVE") == number("hal/ports/usb_transfers.py", "ALIVE")
    assert number("leftovers.py", "_ADDRESS") == number("hal/rp2/usb.py", "ADDRESS_REGISTER")
