"""The kit against the simulator in virtual time: `make conform`."""

from collections.abc import Iterable

from ..boards import LockstepPort, SimulatedBoard
from . import faults, kit, motion, report
from .bench import Bench
from .faults import Fault
from .kit import Result
from .link import Link
from .spoiled import Spoiled

FAULTS = faults.FAULTS + motion.FAULTS


def judge(
    fault: Fault | None = None,
    subjects: Iterable[str] = (),
    motors: int | None = None,
    rig: dict | None = None,
) -> list[Result]:
    """Every result of the kit on a simulated board, as it is or spoiled by a fault."""
    with SimulatedBoard(rig, motors) as board:
        port = LockstepPort(board)
        link = Link(Spoiled(port, fault) if fault else port)
        link.pump(0.3)
        wanted = [c for c in kit.every_check() if not subjects or c.subject in subjects]
        return kit.run(Bench(link, full=True), wanted)


def found(fault: Fault) -> bool:
    """Whether the checks of the fault's subject tell it."""
    try:
        results = judge(fault, (fault.subject,))
    except kit.Failed:
        return True
    return any(r.verdict in (kit.FAULT, kit.DEPARTS) for r in results)


def main() -> None:
    """Print both scores."""
    results = judge()
    for result in results:
        if result.verdict in (kit.FAULT, kit.DEPARTS):
            print(report.line(result))
    print(f"simulator: {len(results)} checks: {report.counts(results)}")
    missed = [fault.name for fault in FAULTS if not found(fault)]
    print(
        f"seeded faults: {len(FAULTS) - len(missed)} of {len(FAULTS)} found",
        *missed,
        sep="\n  missed: ",
    )
    if missed or any(r.verdict in (kit.FAULT, kit.DEPARTS) for r in results):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
