"""Memory that framestep takes on an ESP32, by what the rig file asks for, measured on the simulated
chip. Its heap has the board's word size; machine code there is a RISC-V's."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from ..errors import ToolError
from ..simulator.esp32_board import RISC_V, Esp32Board

HEAP_KB = 2048  # the smallest PSRAM that modules have
_START_NS = 200_000_000
_MARK = "memory:"
_ASK = (
    "import gc, chip, framestep.boot as b; gc.collect(); m = b.controller.moves; "
    "print('memory' + ':', gc.mem_alloc(), chip.code(), len(m.store._memory), m.upload_frames)\r\n"
)


class Memory(NamedTuple):
    """Bytes of the heap besides the move, of machine code, and for the move; frames that fit if all
    motors have data."""

    heap_bytes: int
    code_bytes: int
    move_bytes: int
    frames: int


def memory(rig: Mapping[str, Any], heap_kb: int = HEAP_KB) -> Memory:
    """Measure a board with this rig file. Raises ToolError if it does not start."""
    with Esp32Board(rig, heap_kb=heap_kb, processor=RISC_V) as board:
        said = b""
        for data in (b"", b"\r\x03", _ASK.encode()):
            board.receive(data)
            board.run_until(board.now_ns + _START_NS)
            said = board.transmit()
    line = next((line for line in said.decode().splitlines() if line.startswith(_MARK)), None)
    if line is None:
        raise ToolError(f"framestep did not start with {heap_kb} kB: {said.decode()}")
    taken, code, move, frames = map(int, line.split()[1:])
    return Memory(taken - move, code, move, frames)


def fits(rig: Mapping[str, Any], heap_kb: int) -> bool:
    """Return whether framestep starts with a heap of this size."""
    try:
        return memory(rig, heap_kb).frames > 0
    except ToolError:
        return False
