"""After a soft reset: ends pulses and DMA, which goes on, and starts framestep where it has been.

mpremote makes a soft reset before each of its commands, and MicroPython leaves main.py out then. A
boot.py of your own can begin with these lines.
"""

import micropython

micropython.kbd_intr(-1)  # a Ctrl-C does not break the start off; main.py and the REPL set it again
try:
    import framestep.leftovers
except ImportError:  # framestep has been taken away
    pass
else:
    framestep.leftovers.lower_pins()
    framestep.leftovers.stop_dma()
    if framestep.leftovers.usb_alive():
        import framestep.boot

        framestep.boot.start(True)
