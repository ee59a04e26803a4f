"""Virtual axes: the camera's place and angles instead of motors. Where the rig file wants none, this is all of it."""


class NoVirtuals:
    """Stands for requests.Virtuals where the rig file wants no virtual axes."""

    capabilities = 0
    engaged = 0
    configured = False

    def __init__(self):
        self.handlers = {}

    def poll(self, now):
        return False

    def leads(self, motor):
        return False

    def changed(self, motor):
        pass

    def stop(self):
        pass

    def halt(self, factor=1):
        pass
