"""Pin edges: the records of a trace, and a trace file read while it is written."""

import numpy as np

# Time (ns of virtual time), pin (GPIO number), level (0 or 1).
TRACE_RECORD = np.dtype([("t", "<i8"), ("pin", "u1"), ("level", "u1")])


def edges_from(data):
    """Return the records in data as a numpy array."""
    return np.frombuffer(data, dtype=TRACE_RECORD).copy()


def edge_times(edges, pin, level=None):
    """Return the times (ns) of one pin's edges. The first record of a trace is the starting level,
    not an edge."""
    mine = edges[edges["pin"] == pin]
    return mine["t"] if level is None else mine["t"][mine["level"] == level]


class TraceFile:
    """Follows the file that Emulator.trace_start(file=...) writes: read() returns the records since
    the last call.

    Edges are in the file within 50 ms of real time.
    """

    def __init__(self, path):
        self._file = open(path, "rb")  # noqa: SIM115 -- closed by close()
        self._rest = b""

    def read(self):
        data = self._rest + self._file.read()
        whole = len(data) - len(data) % TRACE_RECORD.itemsize
        self._rest = data[whole:]
        return edges_from(data[:whole])

    def close(self):
        self._file.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()
