"""The store of light levels and triggers as the board's machine code: it answers as on CPython, and in time."""

from pathlib import Path

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from host_tests.board.modules import board_modules
from host_tests.moves import lightplots

RUNTIME = Path(__file__).parents[1] / "runtime"
MODULES = ("__init__", "native", "clock", "copying", "results", "hal/__init__", "io/__init__", "io/lights")
MODULES += ("moves/__init__", "moves/light_levels", "moves/triggers")
MODULES += ("protocol/__init__", "protocol/messages", "protocol/checksum", "protocol/frames")
ANSWER = """
from lightplots_replay import replay
with open("script.txt") as script:
    for answer in replay(line.strip() for line in script):
        print(answer)
"""
MEASURE = """
import gc, time
from framestep.io.lights import Lights
from framestep.moves.light_levels import LightLevels
from framestep.moves.triggers import Triggers
from framestep.protocol.frames import FrameReader
gc.collect()
free = gc.mem_free()
store, triggers = LightLevels(4096), Triggers(512)
gc.collect()
print("bytes", free - gc.mem_free())
lights = Lights(512, 500)
reader = FrameReader()

def fill(slope, count):
    for i in range(count):
        reader.buffer[reader.payload + 6 + i] = i * slope & 255

def levels(channel, count, last=0):
    begun = time.ticks_us()
    code = store.store(channel, 0, last, reader.buffer, reader.payload + 6, count)
    us = time.ticks_diff(time.ticks_us(), begun)
    return us if code == 16 else -us

def step(index, backward):
    begun = time.ticks_us()
    store.step(index, backward, lights)
    return time.ticks_diff(time.ticks_us(), begun)

store.begin(1030)
fill(0, 1030)
print("still", levels(1, 1030))
fill(1, 1000)
print("fades", *[levels(channel, 1000, 1) for channel in (2, 3, 4, 5)])
print("refused", levels(6, 1000, 1))
print("again", levels(5, 1000, 1))
store.begin(100)
fill(3, 100)
for channel in range(1, 37):
    levels(channel, 100)
store.finish()
store.seek(10, lights)
print("steps", step(11, False), step(10, True))
store.begin(100)
for channel in range(3, 513, 16):
    levels(channel, 100)
store.finish()
store.seek(10, lights)
print("apart", step(11, False), step(10, True))
"""


def board_files(**more):
    return {**board_modules(MODULES), **more}


@given(st.lists(lightplots.plots(), min_size=12, max_size=12))
@settings(
    max_examples=3, derandomize=True, database=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck)
)
def test_any_plot(emulator, scripts):
    script = [step for script in scripts for step in script]
    lines = "".join(line + "\n" for line, _ in script)
    files = board_files(
        **{"/lightplots_replay.py": (RUNTIME / "lightplots_replay.py").read_bytes(), "/script.txt": lines.encode()}
    )
    answers = emulator(files=files).repl().exec(ANSWER, timeout=60).split("\n")
    for (line, step), answer, wanted in zip(script, answers, lightplots.expected(script), strict=False):
        assert answer.strip() == wanted, (line[:60], step[:4])
    assert len(answers) >= len(script)


def test_times(emulator):
    printed = emulator(files=board_files()).repl().exec(MEASURE, timeout=60)
    print(printed)
    measured = {line.split()[0]: [int(x) for x in line.split()[1:]] for line in printed.splitlines()}
    assert measured["bytes"][0] < 30_500
    assert 0 < measured["still"][0] < 700
    assert all(0 < us < 8000 for us in measured["fades"])
    assert -2500 < measured["refused"][0] < 0
    assert 0 < measured["again"][0] < 12_000
    assert all(0 < us < 500 for us in measured["steps"])
    assert all(0 < us < 700 for us in measured["apart"]), "32 channels, none beside another"
