"""After a soft reset: ends pulses and DMA, which goes on, and starts framestep where it has been.

mpremote makes a soft reset before each of its commands, and MicroPython leaves main.py out then. A
boot.py of your own can begin with these lines.
"""

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
