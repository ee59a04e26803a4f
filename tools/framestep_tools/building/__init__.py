"""Images: the firmware with constants put in, and MicroPython around it."""
