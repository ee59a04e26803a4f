"""The profile: every cycle belongs to something, and Python functions are followed through calls
and exceptions."""

import pytest

from framestep_emulator import Profile
from framestep_tools.building import images

SETUP = """
import micropython
@micropython.native
def inner(n):
    for i in range(n):
        pass
def middle(n):
    inner(n)
    inner(n)
def failing():
    inner(200)
    raise ValueError
def outer():
    for _ in range(3):
        middle(200)
    try:
        failing()
    except ValueError:
        pass
"""


@pytest.mark.parametrize("mhz", [125, 48])
def test_profile(emulator, mhz):
    emu = emulator()
    repl = emu.repl()
    repl.exec(SETUP)
    repl.exec(f"import machine; machine.freq({mhz} * 1000000)")
    with (
        emu.measure() as measured,
        Profile(emu, images.micropython("rp2").with_suffix(".elf")) as profile,
    ):
        repl.exec("outer()")
    assert sum(profile.firmware.values()) == pytest.approx(measured["busy_cycles"] / mhz, rel=1e-3)
    assert profile.ms == pytest.approx(measured["ms"], rel=1e-3)
    calls = {calls: [f for f in profile.functions if f.calls == calls] for calls in (3, 7)}
    (middle,), (inner,) = calls[3], calls[7]
    assert inner.own_us == inner.inner_us  # it calls nothing
    each = inner.inner_us / 7
    assert middle.inner_us == pytest.approx(middle.own_us + 6 * each, rel=0.05)
    once = [f for f in profile.functions if f.calls == 1]
    failing = [f for f in once if each < f.inner_us < 2 * each]
    assert len(failing) == 1  # it ended with an exception
    assert any(f.inner_us > middle.inner_us + failing[0].inner_us for f in once)
    assert "mp_execute_bytecode" in profile.firmware
