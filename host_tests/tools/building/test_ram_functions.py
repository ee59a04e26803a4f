"""An image finds its functions for RAM by the names that MicroPython's freezing gives them."""

import pytest

from framestep_tools.building import ram_functions
from framestep_tools.building.board_files import board_sources

TEXT = b"""
if RP2350:

    @micropython.viper
    def drive(): pass

else:

    @micropython.viper
    def drive(): pass

@micropython.viper
def levels(): pass

class Port:
    def plain(self): pass

    @micropython.viper
    def poll(self): pass

    @micropython.viper
    def send(self): pass

@micropython.viper
def held(): pass
"""


def symbols(monkeypatch, *wanted):
    monkeypatch.setattr(ram_functions, "RAM_FUNCTIONS", wanted)
    return ram_functions.symbols({"framestep/hal/pins.py": TEXT})


def test_functions_are_numbered_within_their_class(monkeypatch):
    module = "framestep/hal/pins.py"
    wanted = ((module, "", "levels"), (module, "Port", "poll"), (module, "Port", "send"))
    file = "framestep_slash_hal_slash_pins_dot_py"
    assert symbols(monkeypatch, *wanted, (module, "", "held")) == [
        f"framestep_hal_pins_{file}3",
        f"framestep_hal_pins_Port_{file}",
        f"framestep_hal_pins_Port_{file}2",
        f"framestep_hal_pins_{file}4",
    ]


def test_one_that_is_not_there(monkeypatch):
    with pytest.raises(KeyError, match="gone"):
        symbols(monkeypatch, ("framestep/hal/pins.py", "", "gone"))


def test_all_are_there():
    assert len(ram_functions.symbols(board_sources("pico"))) == len(ram_functions.RAM_FUNCTIONS)
