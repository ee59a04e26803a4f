"""Null object for virtual axes, if the rig file wants none."""


class NoVirtuals:
    """Stand-in for requests.VirtualAxes."""

    capabilities = 0
    owned = 0
    configured = False

    def __init__(self):
        self.move = self  # for answers.py, which saves the property

    def poll(self, now):
        return False

    def moves_camera(self, motor):
        return False

    def holds(self, motor):
        return False

    def changed(self, motor):
        pass

    def stop(self):
        pass

    def halt(self, factor=1):
        pass
