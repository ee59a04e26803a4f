"""`make fuzz`: random sessions until the time is up; failures are shrunk to scripts.

    python -m host_tests.fuzz.fuzz --seconds 60 [--seed 7] [--requests 200] [--minutes 15]
                                   [--keep-going] [--replay] [--target rp2350]

Each session's seed is made of the run's seed and its number, so a session can be repeated.
"""

import argparse
import sys
import time
from collections import Counter
from pathlib import Path
from random import Random

from host_tests.script import Script, parse

SCRIPTS = Path(__file__).parent / "scripts"
FOUND = Path(__file__).parents[2] / "build" / "fuzz"
REQUESTS_PER_MINUTE = 1200


def replay(script: Script, tail_ms: int = 0, again=None):
    """Judge a script as it is; return the Trial. Finding if it fails. again: an Again, which plays
    it once more."""
    from .trial import Trial

    trial = (again.trial if again else Trial)(header_of(script))
    try:
        follow(trial, script, tail_ms)
        if again:
            again.judge(trial)
    finally:
        trial.close()
    return trial


def header_of(script: Script) -> Script:
    """Return the same board and rig without events."""
    head = Script(script.board, script.rig)
    head.target = script.target
    head.rig, head.rig_text = script.rig, script.rig_text
    head.motors, head.memory, head.flash, head.says = (
        script.motors, script.memory, script.flash, script.says,
    )  # fmt: skip
    return head


def follow(trial, script: Script, tail_ms: int = 0) -> None:
    """Play a script's events, and let time pass until its end."""
    for ms, verb, argument in script.events:
        while trial.ms < ms:
            trial.step()
        trial.do(verb, argument)
    while trial.ms < script.end + tail_ms:
        trial.step()
    for motor in trial.motors:
        trial.judge(motor)


def fails(script: Script, again=None) -> str | None:
    """Return the kind of finding that a script leads to."""
    from .findings import Finding

    try:
        replay(script, again=again)
    except Finding as finding:
        return finding.kind
    return None


def shrink(script: Script, kind: str, seconds: float = 60.0, again=None) -> Script:
    """Leave out events, and then time, as long as the same kind of finding remains."""
    until = time.monotonic() + seconds

    def tried(events, end):
        candidate = header_of(script)
        candidate.events, candidate.end = list(events), end
        return candidate if fails(candidate, again) == kind else None

    best = tried(script.events, script.end)
    if best is None:
        return script
    parts = 2
    while time.monotonic() < until and len(best.events) > 1:
        size = max(1, len(best.events) // parts)
        for at in range(len(best.events) - size, -1, -size):
            smaller = tried(best.events[:at] + best.events[at + size :], best.end)
            if smaller is not None:
                best = smaller
                break
            if time.monotonic() > until:
                break
        else:
            if size == 1:
                break
            parts = min(parts * 2, len(best.events))
            continue
        parts = max(parts - 1, 2)
    # time between events
    i = 0
    while i < len(best.events) and time.monotonic() < until:
        before = best.events[i - 1][0] if i else 0
        gap = best.events[i][0] - before
        for less in (gap, gap // 2, gap // 4):
            if less > 0:
                events = [
                    (t - less if k >= i else t, v, a) for k, (t, v, a) in enumerate(best.events)
                ]
                smaller = tried(events, best.end - less)
                if smaller is not None:
                    best = smaller
                    break
        i += 1
    return best


def keep(script: Script, finding, seed: str, again=None) -> Path:
    """Shrink the script that failed and write it to a file."""
    script.end = script.events[-1][0] if script.events else 0
    script = shrink_from(script, finding, again)
    FOUND.mkdir(parents=True, exist_ok=True)
    script.says = [str(finding), f"seed {seed}"]
    path = FOUND / f"{finding.kind}-{seed.replace('/', '-')}.txt"
    path.write_text("\n".join(script.lines()) + "\n")
    return path


def shrink_from(script: Script, finding, again=None) -> Script:
    whole = header_of(script)
    whole.events, whole.end = script.events, finding.ms
    return shrink(whole, finding.kind, again=again if finding.kind == "again" else None)


def session(seed: str, requests: int, minutes: float = 0.5, again=None, target: str = "host"):
    """Play one session; return (Trial, Finding or None)."""
    from .findings import Finding
    from .rigs import draw_script
    from .trial import Trial
    from .world import World

    dice = Random(seed)
    trial = (again.trial if again else Trial)(draw_script(dice, target))
    try:
        World(dice, trial, requests, round(minutes * 60_000)).run()
        if again:
            again.judge(trial)
    except Finding as finding:
        finding.ms = trial.ms + 1
        return trial, finding
    finally:
        trial.close()
    return trial, None


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scripts", nargs="*", help="replay these instead")
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--target", default="host", help="what plays the sessions: rp2350, esp32 …")
    parser.add_argument("--seed", default=None)
    parser.add_argument("--first", type=int, default=0, help="number of the first session")
    parser.add_argument("--sessions", type=int, default=10**9)
    parser.add_argument("--minutes", type=float, default=0.5, help="of a session, at most")
    parser.add_argument("--requests", type=int, help="of a session, at most; 1200 a minute")
    parser.add_argument(
        "--replay",
        action="store_true",
        help="play each session again on 32-bit MicroPython, the heap locked and weighed",
    )
    parser.add_argument(
        "--keep-going",
        action="store_true",
        help="after a finding as well; each kind is shrunk once",
    )
    options = parser.parse_args()
    if options.replay and options.target != "host":
        parser.error("--replay needs --target host")
    from host_tests import machine_code

    machine_code.install()
    from framestep.base import native_cpython
    from framestep_emulator import Emulator, Pool

    from .chip_player import CHIPS

    if options.target not in ("host", *CHIPS):
        parser.error(f"--target {options.target} is none of host, {', '.join(CHIPS)}")
    Emulator.pool = Pool()  # a process for each board would take longer than a session

    again = None
    if options.replay:
        from .again import Again

        again = Again()
    if options.scripts:
        return replay_all(options.scripts, again)
    requests = options.requests or round(options.minutes * REQUESTS_PER_MINUTE)
    seed = options.seed if options.seed not in (None, "") else f"{time.time_ns() % 10**9:09d}"
    began = reported = time.monotonic()
    counts: Counter = Counter()
    kinds: Counter = Counter()
    virtual_ms = played = 0
    worst = 0
    for number in range(options.first, options.first + options.sessions):
        if played and time.monotonic() - began > options.seconds:
            break
        name = f"{seed}/{number}"
        trial, finding = session(name, requests, options.minutes, again, options.target)
        played += 1
        counts += trial.counts
        virtual_ms += trial.ms
        if finding is not None:
            worst = 1
            kinds[finding.kind] += 1
            print(f"session {name}: {finding}", flush=True)
            if kinds[finding.kind] <= (2 if options.keep_going else 1):
                print(f"  kept as {keep(trial.script, finding, name, again)}", flush=True)
            if not options.keep_going:
                break
        now = time.monotonic()
        if now - reported > 10:
            reported = now
            native_cpython.forget()  # the controllers of these sessions
            print(
                f"{counts['requests']} requests in {played} sessions, "
                f"{counts['requests'] / (now - began):.0f}/s, "
                f"{virtual_ms / 1000 / (now - began):.1f} x time",
                flush=True,
            )
    took = time.monotonic() - began
    found = ", ".join(f"{n} {kind}" for kind, n in kinds.items()) or "nothing found"
    if not counts["requests"]:
        print("no request was played")
        worst = 1
    print(
        f"seed {seed}: {counts['requests']} requests in {played} sessions, "
        f"{virtual_ms / 1000:.0f} s of virtual time, {counts['edges']} edges, "
        f"{counts['runs judged']} runs judged frame by frame, in {took:.0f} s: {found}"
    )
    return worst


def replay_all(names, again=None) -> int:
    """Print for each script what it leads to."""
    from .findings import Finding

    bad = 0
    for name in names:
        with open(name) as file:
            script = parse(file)
        try:
            replay(script, again=again)
            print(f"{name}: passes")
        except Finding as finding:
            print(f"{name}: {finding}")
            bad = 1
    return bad


if __name__ == "__main__":
    sys.exit(main())
