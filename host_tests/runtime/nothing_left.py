"""Runs on MicroPython: how much memory some moves of eight motors leave allocated."""

import gc

from motion_replay import Rig

rig = Rig(8)
for i in range(8):
    rig.axes[i].set_speed(20000, 100000)
    rig.axes[i].set_jerk(5000)


def run(turns):
    for i in range(turns):
        for k in range(8):
            rig.words[1] = (i * 7919 + k * 104729) % 5000
            rig.axes[k].move_to(rig, rig.words, 1, 10000)
        for _ in range(25):
            rig.clock[0] += 1000
            rig.feed()
            rig.tick(None)
        rig.axes.stop(1)


run(2)
gc.collect()
gc.disable()
before = gc.mem_alloc()
run(20)
print(gc.mem_alloc() - before)
