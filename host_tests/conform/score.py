"""How reliable the kit is, `make conform`: no alarm on correct devices, one on each seeded fault.
All devices are simulated boards, in virtual time.

`make conform BOARD=pico2` runs the kit once on an emulated board, `BOARD=esp32_595` on a
simulated ESP32; ARGS="--subject framing" runs a part of it.
"""

import argparse
import itertools
import sys
from collections.abc import Iterable, Sequence

from framestep_tools.conform import kit, report
from framestep_tools.conform.checks import every_check
from framestep_tools.conform.kit import Result

from . import coupled_faults, faults, motion_faults
from .faults import Fault
from .simulated import BOARDS, results, results_on
from .variants import VARIANTS, Variant

FAULTS = faults.FAULTS + motion_faults.FAULTS + coupled_faults.FAULTS
_ALARMS = (kit.FAULT, kit.DEPARTS)


def judge(variant: Variant, subjects: Iterable[str] = ()) -> list[Result]:
    """Return all results on a correct device."""
    behaviour = variant.behave() if variant.behave else None
    return list(results(behaviour, subjects, variant.motors, variant.rig))


def alarms(results: Iterable[Result]) -> list[str]:
    """Return the results that speak against the device."""
    return [report.line(result) for result in results if result.verdict in _ALARMS]


def found(fault: Fault) -> bool:
    """Whether a check of the fault's subject finds it."""
    try:
        found = results(fault.behave(), (fault.subject,))
        return any(result.verdict in _ALARMS for result in found)
    except kit.Failed:
        return True


def play_on(board: str, subjects: Iterable[str]) -> None:
    """Print what the kit finds on one board. SystemExit if there is an alarm, or no check."""
    reported: list[Result] = []
    played = itertools.groupby(results_on(board, subjects), lambda result: result.check.subject)
    for subject, results_of_it in played:
        found = list(results_of_it)
        print(f"{subject}: {report.counts(found)}", flush=True)
        for line in alarms(found):
            print(f"  {line}", flush=True)
        reported += found
    print(f"{board}: {len(reported)} checks: {report.counts(reported)}")
    if alarms(reported) or not reported:
        raise SystemExit(1)


def main(words: Sequence[str] = ()) -> None:
    """Print both scores, or play on one board."""
    names = sorted({check.subject for check in every_check()})
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--board", choices=BOARDS)
    parser.add_argument("--subject", action="append", choices=names, help="only this one")
    options = parser.parse_args(words)
    if options.subject and not options.board:
        parser.error("--subject needs --board")
    if options.board:
        play_on(options.board, options.subject or ())
        return
    if not VARIANTS or not FAULTS:
        raise SystemExit("no correct device, or no seeded fault, to try the kit on")
    false = 0
    for variant in VARIANTS:
        reported = judge(variant)
        if not reported:
            raise SystemExit(f"{variant.name}: no check has run")
        print(f"{variant.name}: {len(reported)} checks: {report.counts(reported)}")
        for line in alarms(reported):
            false += 1
            print(f"  {line}")
    missed = [fault.name for fault in FAULTS if not found(fault)]
    print(f"correct devices: {false} false alarms")
    print(f"seeded faults: {len(FAULTS) - len(missed)} of {len(FAULTS)} found")
    for name in missed:
        print(f"  missed: {name}")
    if missed or false:
        raise SystemExit(1)


if __name__ == "__main__":
    main(sys.argv[1:])
