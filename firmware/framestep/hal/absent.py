"""What stands for parts that a board has not, or that its rig does without: see
framestep.hal.contract."""


class NoWatchdog:
    """For boards without a watchdog, and for rigs that do without."""

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
