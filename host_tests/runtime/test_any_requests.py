"""Requests of all types in any order, valid and spoilt, on 32 bits with the heap locked: byte by
byte as on CPython.

On a board the heap is locked in a pass of the main loop, so a pass that allocates, however rarely,
would end all later ones.
"""

import random
import struct
import sys
from pathlib import Path

import pytest

from framestep_tools.client.wire import FrameDecoder, encode

HERE = Path(__file__).parent
SCRIPTS = ("session_replay", "virtual_replay", "realtime_replay")
REQUESTS = 400
PLAY = """
import sys
from session_replay import replay
played = []
for line in open(sys.argv[1]):
    wait, data = line.split()
    played.append((int(wait), bytes.fromhex(data)))
replay(print, played)
"""
ODD = (0, 1, -1, 2, 255, 10_000, 2**30 - 1, 2**30, -(2**30) - 1, 2**31 - 1, -(2**31))


def pool():
    """Return (type, payload) of every request in the scripts next to this file."""
    found = []
    for name in SCRIPTS:
        for _, data in sys.modules[name].script():
            found += [(f.type, f.payload) for f in FrameDecoder().feed(data)]
    return found


def spoilt(dice, payload):
    """Return the payload with a number or some bytes replaced."""
    changed = bytearray(payload)
    if len(changed) >= 4 and dice.random() < 0.6:
        struct.pack_into("<i", changed, dice.randrange(len(changed) - 3), dice.choice(ODD))
    else:
        for _ in range(dice.randint(1, 3)):
            changed[dice.randrange(len(changed))] = dice.randrange(256)
    return bytes(changed)


def any_requests(seed):
    """Return [(milliseconds to pass afterwards, bytes)]"""
    dice = random.Random(seed)
    sound = pool()
    played = []
    for _ in range(REQUESTS):
        kind, payload = dice.choice(sound)
        if payload and dice.random() < 0.35:
            payload = spoilt(dice, payload)
        data = encode(kind, payload, dice.choice((1, 77, 2**30, 2**32 - 1)))
        if dice.random() < 0.05:
            data = data[: dice.randrange(1, len(data))]
        played.append((dice.choice((1, 2, 3, 10, 30, 100, 300)), data))
    return played


@pytest.fixture
def replays(monkeypatch):
    monkeypatch.syspath_prepend(str(HERE))
    for name in SCRIPTS:
        __import__(name)
    yield sys.modules["session_replay"]
    for name in SCRIPTS:
        sys.modules.pop(name, None)


@pytest.mark.parametrize("seed", range(4))
def test_any_requests(seed, runtime, replays, tmp_path):
    played = runtime.share(any_requests(seed))
    script = tmp_path / "requests"
    script.write_text("".join(f"{wait} {data.hex()}\n" for wait, data in played))
    lines = []
    said = runtime.run(PLAY, script, path=[HERE], heap="4M").split("\n")[:-1]
    try:
        replays.replay(lines.append, played)
    except OverflowError:
        # a position beyond a word wraps on the board, and CPython's arrays refuse it
        said = said[: len(lines)]
    assert said == lines
    # and most of them had a meaning
    codes = [
        f.payload[:2]
        for line in lines[:-1]
        for f in FrameDecoder().feed(bytes.fromhex(line.split()[1]))
    ]
    assert len(set(codes)) > 5
    assert len(codes) > len(played) // 2
