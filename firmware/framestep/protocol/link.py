"""The connection to the host."""

from framestep.protocol.frames import FrameReader, FrameWriter
from framestep.protocol.messages import LARGEST_FRAME


class Link:
    """A port with the reader of its requests and the writer of answers and reports; and handlers of
    requests by number, to which each part adds its own.

    port: Hal.port, see hal/contract.py. dword_acks: Rig.dword_acks.
    """

    def __init__(self, port, dword_acks):
        self.port = port
        self.reader = FrameReader()
        self.writer = FrameWriter(LARGEST_FRAME)
        self.dword_acks = dword_acks
        self.handlers = {}
