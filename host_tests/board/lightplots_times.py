"""Runs on the board: how long the store of light levels takes, in microseconds."""

import gc
import time

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
