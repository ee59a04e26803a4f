"""What firmware/boot.py knows of the core without importing it."""

import re

from framestep_tools.files import FIRMWARE


def number(file, name):
    """A constant of a module, of which others may make use in it."""
    text = (FIRMWARE / "framestep" / file).read_text()
    found = re.search(rf"^{name} = (?:const\()?(.+?)\)?(?:  #.*)?$", text, re.MULTILINE)
    assert found, f"{file} has no {name}"
    return eval(found[1], {})


def test_boot_py_looks_where_the_port_leaves_its_mark():
    boot = (FIRMWARE / "boot.py").read_text()
    at = number("hal/rp2_usb.py", "_MEMORY") + number("hal/usb_transfers.py", "KEPT_AT")
    assert f"mem32[0x{at:08X}] == 0x{number('hal/usb_transfers.py', 'ALIVE'):08X}" in boot
    address = number("hal/rp2_usb.py", "ADDRESS_REGISTER")
    assert f"mem32[0x{address:08X}] & 0x7F" in boot
