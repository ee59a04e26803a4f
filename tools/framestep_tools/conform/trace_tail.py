"""A device's pins, from a trace that is written while it runs (`make sim`, `make emu` with
--trace)."""

import os
import time
from pathlib import Path

from ..judge.trace import HEADER, Edge, TraceError

_WRITTEN_S = 0.3  # after this time an edge is in the file


class TraceTail:
    """The edges that a trace file receives from now on. Raises TraceError if it is not a trace."""

    def __init__(self, path: Path):
        self.path = path
        try:
            self._file = path.open("rb")
        except OSError as error:
            raise TraceError(f"cannot read {path}: {error.strerror}") from None
        found = self._file.readline().decode(errors="replace").strip()
        if found != HEADER:
            raise TraceError(f"{path}: expected the header {HEADER!r}, found {found[:60]!r}")
        self._file.seek(0, os.SEEK_END)
        # skip the unfinished row
        self._rest = b""
        self._skip = not self._at_row()

    def _at_row(self) -> bool:
        self._file.seek(-1, os.SEEK_CUR)
        return self._file.read(1) == b"\n"

    def take(self) -> list[Edge]:
        """Return the edges since the last call."""
        time.sleep(_WRITTEN_S)
        rows = (self._rest + self._file.read()).split(b"\n")
        self._rest = rows.pop()
        if self._skip and rows:
            self._skip = False
            rows = rows[1:]
        return sorted(map(self._edge, rows), key=lambda edge: edge[0])

    def _edge(self, row: bytes) -> Edge:
        try:
            time_ns, signal, value = row.decode().split(",")
            return int(time_ns), signal, int(value)
        except ValueError:
            raise TraceError(
                f"{self.path}: expected a row of time, signal and value, found {row[:60]!r}"
            ) from None

    def close(self) -> None:
        """Close the file."""
        self._file.close()
