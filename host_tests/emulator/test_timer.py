"""A hard machine.Timer at 1 kHz."""

import numpy as np
import pytest

from framestep_emulator import edge_times

SETUP = """
import machine, micropython, time, gc
pin = machine.Pin(2, machine.Pin.OUT)
@micropython.viper
def toggle(t):
    ptr32(0xd000001c)[0] = 4
def load(ms):
    t = time.ticks_ms()
    while time.ticks_diff(time.ticks_ms(), t) < ms:
        x = [bytearray(20) for i in range(50)]
"""


@pytest.mark.parametrize("work, jitter_us", [("time.sleep_ms(300)", 1), ("load(300)", 10)])
def test_hard_timer(emulator, work, jitter_us):
    """An edge each millisecond, during sleep, allocation and garbage collection."""
    emu = emulator()
    repl = emu.repl()
    repl.exec(SETUP)
    emu.trace_start([2])
    repl.exec(f"t = machine.Timer(-1, freq=1000, callback=toggle, hard=True)\n{work}\nt.deinit()")
    gaps = np.diff(edge_times(emu.trace_stop(), 2)[2:])  # the first one pays for a cold cache
    assert len(gaps) > 290
    assert abs(gaps - 1_000_000).max() < jitter_us * 1000


def test_how_long_interrupts_are_off(emulator):
    """The longest time counts, but not the time of writing to flash."""
    emu = emulator()
    repl = emu.repl()
    repl.exec(
        "import machine, time\n"
        "def hold(us):\n"
        "    state = machine.disable_irq()\n"
        "    time.sleep_us(us)\n"
        "    machine.enable_irq(state)\n"
    )
    emu.cycles(clear=True)
    repl.exec("hold(50)\nhold(700)\nhold(300)")
    assert 700 <= emu.cycles()["masked"]["us"] < 760
    emu.cycles(clear=True)
    repl.exec("open('x', 'w').write(5000 * 'x')")
    assert emu.cycles()["masked"]["us"] < 50


def test_a_word_of_memory_is_watched(emulator):
    """It is seen to grow when it does; less than `least` does not count, nor does a decrease."""
    emu = emulator()
    repl = emu.repl()
    repl.exec("import array, time, uctypes\nwords = array.array('i', [0, 7])")
    address = repl.eval("uctypes.addressof(words) + 4")
    emu.cmd("growth", address=address, least=10)
    begun = emu.ns
    repl.exec(
        "for more in (9, 50, -100, 10):\n"
        "    time.sleep_ms(20)\n"
        "    words[0] += 1000\n"
        "    words[1] += more\n"
    )
    (first, by), (last, at_last) = emu.cmd("growth")["growths"]
    assert (by, at_last) == (50, 10)
    assert begun < first < emu.ns
    assert abs(last - first - 40_000_000) < 1_000_000
    assert emu.cmd("growth")["growths"] == []
