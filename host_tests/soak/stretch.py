"""A stretch of rounds: played here in virtual time, then again on 32-bit MicroPython."""

from dataclasses import dataclass
from pathlib import Path

from framestep.base.clock import WIDE_WRAP, WRAP
from host_tests.end_to_end.session import simulated
from host_tests.recording import REPLAY, Recording, recorded, write
from host_tests.soak.rounds import MOTORS, RIG, Rounds

_LED_MS = 2048  # what the milliseconds at the start have to be a multiple of
_LEAST = 3  # rounds
_HEAP = "2M"
_LIMIT_S = 3600  # against a hang


@dataclass
class Stretch:
    """What a stretch was: emulated seconds, rounds, motions checked, bytes of the heap after each
    round, and what was wrong ("" for nothing)."""

    seconds: float
    rounds: int
    motions: int
    heap: list[int]
    wrong: str = ""


def play(runtime, seconds: float, seed: int, path: Path) -> Stretch:
    """Rounds for so many seconds of the board's time, at least three, and all of it again on
    32-bit MicroPython."""
    found, recording, wrap_ms = record(seconds, seed)
    replay(runtime, found, recording, wrap_ms, path)
    return found


def record(seconds: float, seed: int) -> tuple[Stretch, Recording, int]:
    """The rounds themselves, and a millisecond inside the first run at which counters may wrap."""
    with recorded() as recorders:
        session = simulated(RIG, MOTORS)
        (recorder,) = recorders
        rounds = Rounds(session, seed)
        count = 0
        while session.now < seconds or count < _LEAST:
            rounds.round()
            count += 1
            recorder.weigh()
        recording = recorder.finish()
    found = Stretch(session.now, count, rounds.motions, [])
    return found, recording, _inside(rounds.runs[0])


def replay(
    runtime, found: Stretch, recording: Recording, wrap_ms: int, path: Path, script: Path = REPLAY
) -> None:
    """Play a recording again; `found` gets the bytes of the heap and what was wrong.

    runtime: the fixture unix32f. There the heap is locked in every tick and every pass, the tick
    counter, the milliseconds, the microseconds and the queues' indices all wrap inside the first
    run, and what the board does must be the same, byte by byte and cue by cue. path: where the
    recording is written to; script: what plays it.
    """
    write(recording, path)
    said = runtime.run(
        script, path, WRAP + 1 - wrap_ms, WIDE_WRAP + 1 - wrap_ms, heap=_HEAP, timeout=_LIMIT_S
    ).split("\n")[:-1]
    found.heap = [int(line.split()[1]) for line in said if line.startswith("heap ")]
    found.wrong = _difference(
        recording.did, [line for line in said if not line.startswith("heap ")]
    ) or _growth(found.heap)


def _inside(run: tuple[float, float]) -> int:
    """A millisecond inside the run at which the counters may wrap."""
    begin, end = run
    at = int(begin * 1000 / _LED_MS + 1) * _LED_MS
    assert begin * 1000 < at < end * 1000 - 500, f"the first run, {run}, has no such moment"
    return at


def _difference(did: list[str], said: list[str]) -> str:
    if did == said:
        return ""
    at = next(
        (i for i, (a, b) in enumerate(zip(did, said, strict=False)) if a != b),
        min(len(did), len(said)),
    )
    return f"line {at}: here {did[at : at + 1]}, on 32 bits {said[at : at + 1]}"


def _growth(heap: list[int]) -> str:
    """No pass can take memory, since the heap is locked; nor may what is done between them (a port
    that opens, bytes that come) leave any behind."""
    if len(heap) >= _LEAST and len(set(heap)) == 1:
        return ""
    return f"the heap is not as full after each round: {heap} bytes"
