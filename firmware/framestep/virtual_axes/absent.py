"""What there is of virtual axes where the rig file wants none."""


class NoVirtuals:
    """Stands for requests.Virtuals where the rig file wants no virtual axes."""

    capabilities = 0
    engaged = 0
    configured = False

    def __init__(self):
        self.handlers = {}

    def poll(self, now):
        return False

    def moves_camera(self, motor):
        return False

    def changed(self, motor):
        pass

    def stop(self):
        pass

    def halt(self, factor=1):
        pass
