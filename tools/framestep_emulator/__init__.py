"""Real MicroPython firmware on an emulated RP2040, driven from Python. README.md is the manual."""

from .emulator import Emulator, EmulatorError, device_file
from .node import Pool
from .ports import PtyBridge, Serial
from .profile import Profile
from .repl import Repl, ReplError
from .trace import TRACE_RECORD, TraceFile, edge_times, edges_from

__all__ = [
    "TRACE_RECORD",
    "Emulator",
    "EmulatorError",
    "Pool",
    "Profile",
    "PtyBridge",
    "Repl",
    "ReplError",
    "Serial",
    "TraceFile",
    "device_file",
    "edge_times",
    "edges_from",
]
