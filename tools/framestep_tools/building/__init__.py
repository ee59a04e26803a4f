"""Images: MicroPython with the firmware frozen in, and constants folded into it."""
