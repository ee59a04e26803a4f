"""Null objects for hardware that a board lacks or a rig does not use: see
framestep.hal.contract."""


class NoWatchdog:
    """For boards without a watchdog, and rigs that do not use it."""

    caused_reset = False

    def arm(self, ms):
        pass

    def feed(self):
        pass

    def disarm(self):
        pass


class NoDmx:
    """For boards without DMX."""

    channels = 0

    def show(self, lights):
        pass
