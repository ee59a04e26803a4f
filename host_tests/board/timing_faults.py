"""Faults of time, put into the image as an overlay, and what finds them on the emulated Pico.

    python -m host_tests.board.timing_faults                   all of them
    python -m host_tests.board.timing_faults pass_of_300_ms    this one

For each: the session of fuzz/sessions.py that has to reveal it, and which observer does. Some are
within what a host may see; they have no observer, and nothing is found. test_fuzz.py plays some.
FRAMESTEP_TIMING_FAULT=pass_of_3_ms puts one into the boards of `pytest --target rp2040`.
"""

import argparse
import functools
import time
from collections.abc import Callable
from typing import NamedTuple

from framestep_emulator import Emulator, Pool
from framestep_tools.building.board_files import board_module, compiled, folded, sources
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.board.modules import ident_of, on_board
from host_tests.fuzz import chip_player
from host_tests.fuzz.findings import Finding
from host_tests.fuzz.sessions import (
    Host,
    asked_often,
    asked_while_coming_to_rest,
    jogs_beside,
    moves,
    run,
    two_moves,
)
from host_tests.observers import timing

TARGET = "rp2040"


class Fault(NamedTuple):
    """A text of one of the core's modules, and the one that takes its place.

    kinds: of findings, as a regular expression, in this session; "": none. top: lines at the
    module's beginning.
    """

    module: str
    old: str
    new: str
    kinds: str
    session: Callable[[Host], None] = moves
    top: str = ""


def _in_pass(when: str, *then: str, kinds: str, session: Callable[[Host], None] = moves) -> Fault:
    """Do something at the beginning of some passes. `now`: milliseconds."""
    lines = "".join(f"            {line}\n" for line in then)
    begin = "        now &= WRAP\n"
    top = "from machine import disable_irq, enable_irq\nfrom time import sleep_us\n"
    return Fault("controller", begin, f"{begin}        if {when}:\n{lines}", kinds, session, top)


def _masked(us: int, kinds: str, times: int = 1) -> Fault:
    """Keep interrupts off; a longer sleep than a millisecond would wait for one."""
    sleeps = [f"sleep_us({us})"] * times
    off = ["state = disable_irq()", *sleeps, "enable_irq(state)"]
    return _in_pass("now & 127 == 7", *off, kinds=kinds)


def _with(module: str, line: str, more: str, kinds: str, session=moves) -> Fault:
    """Add lines after this one."""
    return Fault(module, line, line + more, kinds, session)


_TICK = "pulse/tick"
_MOVES = "self.reports.was_moving and now & 511 == 7"
_CYCLES = "        cycles = m[sw.CYCLES]\n"
_PUT = """\
                        put(
                            fifo,
                            ((((period - m[sw.FIXED]) << _PULSE_BITS) + pulses) << engine.PULSES)
                            + m[sw.WORD],
                        )
                        if back:
"""
_PUT_MOST = """\
                        if h[sw.TICKS] & 127 - 9:
                            put(
                                fifo,
                                (
                                    (((period - m[sw.FIXED]) << _PULSE_BITS) + pulses)
                                    << engine.PULSES
                                )
                                + m[sw.WORD],
                            )
                        if back:
"""


def _sessions(host: Host) -> None:
    for session in (run, asked_often, asked_while_coming_to_rest):
        session(host)


FAULTS = {
    "none": _in_pass("now < 0", "pass", kinds="", session=_sessions),
    "pass_of_3_ms": _in_pass("now & 63 == 7", "sleep_us(3000)", kinds="passes", session=run),
    "pass_of_90_ms": _in_pass(_MOVES, "sleep_us(90000)", kinds="passes", session=run),
    "pass_of_900_ms": _in_pass(_MOVES, "sleep_us(900000)", kinds="passes|fault|unanswered|pins"),
    "interrupts_off_for_180_us": _masked(180, "masked|late"),
    "interrupts_off_for_400_us": _masked(400, "masked|late"),
    "interrupts_off_for_1_3_ms": _masked(650, "masked|late", 2),
    "call_of_the_tick_lost": _with(
        _TICK,
        "        now = clock[0]\n",
        "        if m[sw.RUNNING]:\n            if now & 0x3FFFF < 1000:\n                return\n",
        "fault|late",
    ),
    "tick_without_commands": _with(
        _TICK,
        f"{_CYCLES}        a = m[sw.FIRST]\n",
        "        if m[sw.TICKS] & 255 == 9:\n            a = 0\n",
        "frames",
        run,
    ),
    "tick_of_1_3_ms": _with(
        _TICK,
        _CYCLES,
        "        if m[sw.TICKS] & 63 == 9:\n"
        "            while (clock[0] - now) & WIDE_WRAP < 1300:\n"
        "                pass\n",
        "late",
    ),
    "ticks_too_long_by_a_thousandth": Fault(
        _TICK, _CYCLES, "        cycles = m[sw.CYCLES] + 125\n", "frames", run
    ),
    "command_lost_in_a_FIFO": Fault(_TICK, _PUT, _PUT_MOST, "pins|goal|positions"),
    "pulses_200_us_late": _with(
        _TICK,
        "                        x = x + carry  # cycles available for the pulses\n",
        "                        if h[sw.TICKS] & 7 == 1:\n"
        "                            x = x + 25000\n",
        "velocity",
        two_moves,
    ),
    "segment_a_tick_too_long": _with(
        _TICK,
        "                                m[sw.LEFT] = q[k]\n",
        "                                if head & 7 == 5:\n"
        "                                    m[sw.LEFT] = q[k] + 1\n",
        "fault",
    ),
    "last_motor_starts_a_tick_late": _with(
        _TICK,
        "                    wait = h[sw.AHEAD] - passed * h[sw.CYCLES_PER_US]\n",
        "                    if a == 0:\n                        wait += cycles\n",
        "frames",
        run,
    ),
    "rest_said_a_tick_early": Fault(
        _TICK,
        "                        m[sw.WAIT] = h[sw.BEHIND]\n",
        "                        m[sw.WAIT] = 1\n",
        "quiet",
        asked_while_coming_to_rest,
    ),
    "positions_sampled_every_32_ms": Fault(
        "controller",
        "        alarm = sample(self.header, self.axes.samples)\n",
        "        alarm = now & 31 == 0 and sample(self.header, self.axes.samples)\n",
        "pins",
        two_moves,
    ),
    "queues_filled_every_128_ms": Fault(
        "controller",
        "self.axes.feed(planned) or planned\n",
        "now & 127 < 8 and self.axes.feed(planned) or planned\n",
        "fault",
        run,
    ),
    "requests_wait_for_900_ms": Fault(
        "controller",
        "        taken = port.poll(reader)\n",
        "        taken = self.now & 1023 > 900 and port.poll(reader)\n",
        "unanswered",
    ),
    "requests_wait_for_30_ms": Fault(
        "controller",
        "        taken = port.poll(reader)\n",
        "        taken = self.now & 127 > 30 and port.poll(reader)\n",
        "slow",
        asked_often,
    ),
    "end_of_jogs_looked_for_every_16_s": Fault(
        "controller",
        "            self.motors.end_jogs(now)\n",
        "            if now & 16383 < 8:\n                self.motors.end_jogs(now)\n",
        "jog",
        jogs_beside,
    ),
    "end_of_a_run_said_a_minute_late": Fault(
        "reports",
        "        if self.operations.rt_end_due:\n",
        "        if self.operations.rt_end_due and now & 65535 < 8:\n",
        "rt-end",
        run,
    ),
}


def edited(fault: Fault) -> tuple[str, str]:
    """Return the module with the fault: its path and its text. ValueError if it has no place
    there, or more than one."""
    name = f"framestep/{fault.module}.py"
    text = sources()[name].read_text()
    if text.count(fault.old) != 1:
        raise ValueError(f"{name} has {text.count(fault.old)} times: {fault.old}")
    imports = text.index("\nfrom ") + 1
    return name, text[:imports] + fault.top + text[imports:].replace(fault.old, fault.new)


@functools.cache
def _modules(*faulty: str) -> dict[str, bytes]:
    return folded(
        {"framestep/board.py": board_module("pico")} | dict([faulty] if faulty else []), hide=True
    )


def files(fault: Fault) -> dict[str, bytes]:
    """Return the files of a Pico with this fault."""
    changed = {
        name.replace(".py", ".mpy"): compiled(name, source, "armv6m")
        for name, source in _modules(*edited(fault)).items()
        if source != _modules()[name]
    }
    return on_board(ident_of("pico"), changed)


def found(fault: Fault) -> Finding | None:
    """Play the fault's session; return what is found first."""
    before = chip_player.CHIPS[TARGET]
    make = functools.partial(EmulatedBoard, files=files(fault))
    chip_player.CHIPS[TARGET] = before._replace(make=make)
    timing.addresses.clear()
    host = None
    try:
        host = Host({"motor_count": 2, "estop": "no"}, target=TARGET)
        fault.session(host)
        host.wait(500)
        host.rest()
    except Finding as finding:
        return finding
    finally:
        if host:
            host.trial.close()
        chip_player.CHIPS[TARGET] = before
        timing.addresses.clear()
    return None


def as_expected(fault: Fault, finding: Finding | None) -> bool:
    """Whether it is what this fault has to lead to."""
    return (finding.kind if finding else "") in fault.kinds.split("|")


def main() -> None:
    """Print what is found. SystemExit if it is not as expected."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    names = parser.parse_args().names or list(FAULTS)
    if unknown := set(names) - set(FAULTS):
        parser.error(f"there is no {', '.join(unknown)}; there are {', '.join(FAULTS)}")
    wrong = []
    Emulator.pool = Pool()
    for name in names:
        begun = time.monotonic()
        finding = found(FAULTS[name])
        took = time.monotonic() - begun
        if not as_expected(FAULTS[name], finding):
            wrong.append(name)
        print(f"{name:34} {finding or 'nothing found'} ({took:.0f} s)", flush=True)
    Emulator.pool.close()
    if wrong:
        raise SystemExit(f"not as expected: {', '.join(wrong)}")


if __name__ == "__main__":
    main()
