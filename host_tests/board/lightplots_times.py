"""Runs on the board: how long the store of light levels takes, in microseconds."""

import gc
import time

from framestep.io.lights import Lights
from framestep.moves.upload.light_levels import LightLevels
from framestep.moves.upload.store import UploadStore
from framestep.moves.upload.triggers import Triggers
from framestep.protocol.frames import FrameReader

gc.collect()
shared = UploadStore(8, 100_000)
gc.collect()
free = gc.mem_free()
store, triggers = LightLevels(shared), Triggers(shared)
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


def step(index):
    begun = time.ticks_us()
    store.step(index, lights)
    return time.ticks_diff(time.ticks_us(), begun)


def begin(frames):
    shared.clear()
    store.begin(frames)


begin(1000)
fill(0, 1000)
print("still", levels(1, 1000))
fill(1, 1000)
print("fades", *[levels(channel, 1000, 1) for channel in (2, 3, 4, 5)])
fill(89, 1000)
for i in range(1000):
    reader.buffer[reader.payload + 6 + i] ^= i * i >> 3 & 255
print("noise", *[levels(channel, 1000, 1) for channel in range(6, 38)])
print("again", levels(8, 1000, 1))
us = 1
channel = 38
while us > 0:
    channel += 1
    us = levels(channel, 1000, 1)
print("refused", us)
store.finish()
store.seek(0, lights)
print("full", step(997), step(996), step(500), step(501))
begin(100)
fill(3, 100)
for channel in range(1, 37):
    levels(channel, 100)
store.finish()
store.seek(10, lights)
print("steps", step(11), step(10))
begin(100)
for channel in range(3, 513, 16):
    levels(channel, 100)
store.finish()
store.seek(10, lights)
print("apart", step(11), step(10))
