"""Compares two conversations of one host: answers, unasked messages, final positions.

Unless Rules.exact is set, values that depend on time or surroundings are compared by kind only:
positions under way, the last play head, MOTOR_STATUS, general inputs, a device's name, version and
memory, and framestep's own messages about conditions. Positions at rest are compared by value. A
motor is at rest if MOTOR_STATUS has reported that nothing moves and no later request moves
anything.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from .. import payloads as p
from ..client.wire import Frame
from ..errors import ToolError
from ..payloads import TYPE_NAMES, Ack, type_name
from .log import DEVICE, HOST, REPLAY_IDS, Entry
from .sniffer import describe, meaning

_MOVES = {kind for kind, cls in p.REQUESTS.items() if cls.MOVES}
_TURNS = {p.HardStop.TYPE, p.RtEnd.TYPE, p.RtGo.TYPE}  # unasked messages that do not depend on time
_OF_THE_MOMENT = (p.Status, p.InputLevels, p.Condition, p.Exceeded)


@dataclass(frozen=True)
class Rules:
    """What counts as equal. steps: allowed difference of positions at rest; ignored: names of
    messages whose answers are not compared; exact: compare by value even what depends on time."""

    steps: int = 0
    ignored: frozenset[str] = frozenset()
    exact: bool = False


def names_known(names: list[str]) -> frozenset[str]:
    """Return the specification's names of messages, given with or without MSG_. Raises ToolError
    for an unknown one."""
    found = frozenset(name.upper().removeprefix("MSG_") for name in names)
    for name in sorted(found - set(TYPE_NAMES.values())):
        raise ToolError(f"{name} is not a message; framestep lab sniff shows their names")
    return found


@dataclass
class Asked:
    """A request and its answer. `rests`: whether nothing moved, as far as the host could know."""

    time_s: float
    frame: Frame | None
    rests: bool
    answers: list[Frame] = field(default_factory=list)


@dataclass
class Conversation:
    """One host's requests, the unasked messages that do not depend on time, and the last reported
    positions at rest."""

    asked: list[Asked] = field(default_factory=list)
    turns: list[tuple[float, Frame]] = field(default_factory=list)
    strays: int = 0
    last: tuple[int, ...] | None = None
    rests: bool = False


def conversation(entries: list[Entry]) -> Conversation:
    """Sort the entries of a log into a conversation."""
    found = Conversation()
    open_requests: dict[tuple[int, int], Asked] = {}
    for entry in entries:
        frame = entry.frame
        if entry.who == HOST:
            asked = Asked(entry.time_s, frame, found.rests)
            if not (frame and frame.id in REPLAY_IDS):
                found.asked.append(asked)
            if frame:
                open_requests[frame.id, frame.type] = asked
                found.rests &= frame.type not in _MOVES
        elif entry.who == DEVICE and frame:
            said = meaning(frame, False)
            if isinstance(said, p.Positions):
                found.last = tuple(said.steps)
            if frame.id == 0 and not frame.is_ack:
                if frame.type in _TURNS:
                    found.turns.append((entry.time_s, frame))
                continue
            if isinstance(said, p.Status):
                found.rests = said.idle
            to = open_requests.get((frame.id, frame.request_type))
            if to:
                to.answers.append(frame)
            else:
                found.strays += 1
    return found


def differences(before: list[Entry], now: list[Entry], rules: Rules) -> Iterator[str]:
    """Yield sentences about differences between a log and its replay."""
    old, new = conversation(before), conversation(now)
    for one, other in zip(old.asked, new.asked, strict=False):
        for text in _answers(one, other, rules):
            yield f"{one.time_s:10.4f} s  {_heading(one)}: {text}"
    if len(old.asked) != len(new.asked):
        yield f"{len(new.asked)} requests were sent instead of {len(old.asked)}"
    yield from _unasked(old, new, rules)
    if old.strays != new.strays:
        yield f"{new.strays} answers without a request instead of {old.strays}"
    at_rest = (old.rests and new.rests) or rules.exact
    if at_rest and old.last is not None and not _near(old.last, new.last, rules):
        yield f"the last positions are {_list(new.last)} instead of {_list(old.last)}"


def _list(steps: tuple[int, ...] | None) -> str:
    return "not reported" if steps is None else ", ".join(map(str, steps))


def _heading(asked: Asked) -> str:
    if asked.frame is None:
        return "bytes outside frames"
    return f"{type_name(asked.frame.type)} (ID {asked.frame.id})"


def _answers(old: Asked, new: Asked, rules: Rules) -> Iterator[str]:
    if old.frame and type_name(old.frame.type) in rules.ignored:
        return
    if len(old.answers) != len(new.answers):
        yield f"{_count(len(new.answers))} instead of {_count(len(old.answers))}"
        return
    for one, other in zip(old.answers, new.answers, strict=True):
        if not _same(one, other, old.rests and new.rests, rules):
            yield f"{_text(other)} instead of {_text(one)}"


def _count(answers: int) -> str:
    return ("no answer", "an answer")[answers] if answers < 2 else f"{answers} answers"


def _text(frame: Frame) -> str:
    return " ".join(describe(frame, False).split()[2:])


def _same(one: Frame, other: Frame, rests: bool, rules: Rules) -> bool:
    if (one.type, one.payload) == (other.type, other.payload):
        return True
    old, new = meaning(one, False), meaning(other, False)
    if _accepted(old) and _accepted(new):
        return True  # the dialects differ here (field note 1.4)
    if type(old) is not type(new) or old is None:
        return False
    if isinstance(old, Ack) or rules.exact:
        return old == new
    if isinstance(old, _OF_THE_MOMENT):
        return True
    return _same_values(old, new, rests, rules)


def _accepted(said: Any) -> bool:
    if isinstance(said, Ack):
        return said == Ack.OK
    return isinstance(said, p.Moving) and bool(said.moving)


def _same_values(old: Any, new: Any, rests: bool, rules: Rules) -> bool:
    if isinstance(old, p.DeviceInfo):
        return _kind(old) == _kind(new)
    if isinstance(old, p.Positions):
        if not rests:
            return len(old.steps) == len(new.steps)
        return _near(tuple(old.steps), tuple(new.steps), rules)
    if isinstance(old, p.VirtPositions) and not rests:
        return True
    return bool(old == new)


def _kind(info: p.DeviceInfo) -> p.DeviceInfo:
    """Remove values that differ between devices of one kind."""
    return replace(info, name="", major=0, minor=0, revision=0, upload_frames=0)


def _near(old: tuple[int, ...], new: tuple[int, ...] | None, rules: Rules) -> bool:
    return (
        new is not None
        and len(old) == len(new)
        and all(abs(a - b) <= rules.steps for a, b in zip(old, new, strict=True))
    )


def _unasked(old: Conversation, new: Conversation, rules: Rules) -> Iterator[str]:
    """Compare HARD_STOP, RT_END and RT_GO with their values and their order."""
    before, after = (
        [(t, f) for t, f in each.turns if type_name(f.type) not in rules.ignored]
        for each in (old, new)
    )
    for i in range(max(len(before), len(after))):
        one = before[i] if i < len(before) else None
        other = after[i] if i < len(after) else None
        if one and other and one[1][1:] == other[1][1:]:
            continue
        at = (one or other or (0.0,))[0]
        texts = [
            f"{type_name(each[1].type)} {_text(each[1])}".strip() if each else "nothing"
            for each in (other, one)
        ]
        yield f"{at:10.4f} s  unasked: {texts[0]} instead of {texts[1]}"
        return  # later messages are shifted, so do not compare them
