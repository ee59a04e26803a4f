"""main.py of a board that has framestep in its file system: starts framestep, if its files are
complete.

/framestep/modules lists them. It is removed before any of them is changed, and written last.
"""

import os

import micropython

try:
    os.stat("/framestep/modules")
except OSError:
    print("framestep: not started, its files are incomplete; framestep install puts them there")
else:
    # a Ctrl-C must not break off the start; the REPL enables it again
    micropython.kbd_intr(-1)
    try:
        import framestep.boot

        framestep.boot.start()
    except MemoryError:
        print("framestep: this module has too little memory: take one with PSRAM")
        raise
