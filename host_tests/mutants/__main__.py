"""Mutation testing: what of the firmware could be changed without a test that notices?

    python -m host_tests.mutants [--sample 300] [--seed 1] [--files 'motion/*'] [--jobs 2]
                                                                                (make mutants)

cosmic-ray makes the mutants, a random sample of which is tried, each against the tests that call
the function that is changed. A time-out counts as killed. equivalent.txt names mutants that do what
the original does, and why; they do not count.
"""

import argparse
import fnmatch
import math
import queue
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from framestep_tools.files import FIRMWARE

from .judging import KILLED, SURVIVED, TIME_OUT, UNCALLED, Calls, Judge, calls_of, learn
from .mutations import Mutant, sample

CORE = FIRMWARE / "framestep"
PACKAGES = ("protocol", "motion", "moves")
TESTS = [f"host_tests/{name}" for name in ("protocol", "motion", "moves", "motors", "end_to_end")]
EQUIVALENT = Path(__file__).parent / "equivalent.txt"
_SURE = 1.96  # standard deviations to either side for 95 %


def interval(killed: int, count: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share (E. B. Wilson, 1927, JASA 22: 209-212)."""
    share, z = killed / count, _SURE**2 / count
    middle = (share + z / 2) / (1 + z)
    reach = _SURE * math.sqrt(share * (1 - share) / count + z / (4 * count)) / (1 + z)
    return middle - reach, middle + reach


def equivalents() -> set[str]:
    """The mutants that equivalent.txt names, without their line numbers."""
    lines = EQUIVALENT.read_text().splitlines()
    return {line for line in lines if line and not line.startswith(("#", " "))}


def name_of(mutant: Mutant) -> str:
    """As equivalent.txt has it."""
    return f"{mutant.path}: {mutant.before}  ->  {mutant.after}"


def chosen(pattern: str) -> list[str]:
    """Files of the packages that a pattern matches, below firmware/framestep."""
    paths = (f"{name}/{file.name}" for name in PACKAGES for file in (CORE / name).glob("*.py"))
    return sorted(path for path in paths if fnmatch.fnmatch(path, pattern))


def judged(mutants: list[Mutant], calls: Calls, folder: Path, jobs: int) -> list[str]:
    """What becomes of each, told as it comes."""
    judges: queue.Queue[Judge] = queue.Queue()
    for number in range(jobs):
        judges.put(Judge(folder / str(number), calls))
    done = Counter[str]()

    def one(mutant: Mutant) -> str:
        judge = judges.get()
        try:
            verdict = judge.judge(mutant)
        finally:
            judges.put(judge)
        done[verdict] += 1
        if verdict not in (KILLED, TIME_OUT):
            print(f"{verdict}: {mutant}", flush=True)
        if done.total() % 10 == 0:
            print(f"  {done.total()} of {len(mutants)}", flush=True)
        return verdict

    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(one, mutants))


def tell(mutants: list[Mutant], verdicts: list[str]) -> None:
    """The share that is killed, by package and in all."""
    for name in (*PACKAGES, ""):
        found = [v for m, v in zip(mutants, verdicts, strict=True) if m.path.startswith(name)]
        called = [verdict for verdict in found if verdict != UNCALLED]
        if not called:
            continue
        killed = sum(verdict != SURVIVED for verdict in called)
        low, high = interval(killed, len(called))
        print(
            f"{name or 'in all'}: {killed} of {len(called)} killed, "
            f"{100 * killed / len(called):.0f} % (95 % interval {100 * low:.0f} to "
            f"{100 * high:.0f} %), {called.count(TIME_OUT)} of them by a time-out; "
            f"{len(found) - len(called)} more in functions that no test calls"
        )


def main() -> int:
    parser = argparse.ArgumentParser(description="mutation testing of protocol, motion and moves")
    parser.add_argument("--sample", type=int, default=300, help="mutants to try")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--files", default="*", help="a pattern such as 'motion/*'")
    parser.add_argument("--jobs", type=int, default=2, help="at a time")
    parser.add_argument("--calls", type=Path, help="folder that keeps what the tests call")
    options = parser.parse_args()
    paths = chosen(options.files)
    if not paths or options.sample < 1 or options.jobs < 1:
        parser.error("expected at least one file, one mutant and one job")
    known = equivalents()
    mutants = [
        each
        for each in sample(CORE, paths, options.sample, options.seed)
        if name_of(each) not in known
    ]
    with tempfile.TemporaryDirectory(prefix="mutants-") as name:
        folder = Path(name)
        kept = options.calls or folder / "calls"
        kept.mkdir(parents=True, exist_ok=True)
        if not list(kept.glob("*.json")):
            print("what each test calls; this takes some minutes", flush=True)
            learn(kept, TESTS, options.jobs)
        calls = calls_of(kept)
        print(f"{len(mutants)} mutants", flush=True)
        verdicts = judged(mutants, calls, folder, options.jobs)
    tell(mutants, verdicts)
    return 0


if __name__ == "__main__":
    sys.exit(main())
