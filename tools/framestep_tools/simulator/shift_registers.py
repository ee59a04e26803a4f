"""74HC595 shift registers in a chain behind an ESP32's I2S: what was played, as levels of their
outputs.

I2S sends 16-bit stereo in Philips format: in each frame 16 bits of the left sample while WS is low
and 16 of the right one while it is high, the highest first, each bit a clock after the place that
WS gives it. SCK is the chain's clock, SD its data, and with the rising edge of WS its outputs take
what has been shifted in by then. So they change once a frame, in the middle of it.
"""

import os

import numpy as np

from ..errors import ToolError

BITS = 32  # of a frame; as many outputs are told
RECORD = np.dtype([("t", "u8"), ("pin", "u1"), ("level", "u1")])
_HALF = BITS // 2


class ChainError(ToolError):
    """A record of played words that does not say what it should."""


def played(path: str | os.PathLike) -> list[tuple[int, bytes]]:
    """The DMA buffers in a record of the simulated chip (tools/micropython/esp32/i2s.c): when each
    began to be played, in ns, and its bytes. ChainError if it is cut off."""
    with open(path, "rb") as file:
        data = file.read()
    found, end = buffers(data)
    if end != len(data):
        raise ChainError(f"{path}: ends within a buffer")
    return found


def buffers(data: bytes) -> tuple[list[tuple[int, bytes]], int]:
    """The same of a piece of a record, and where the last whole buffer ends in it."""
    found, at = [], 0
    while at + 12 <= len(data):
        end = at + 12 + int.from_bytes(data[at + 8 : at + 12], "little")
        if end > len(data):
            break
        found.append((int.from_bytes(data[at : at + 8], "little"), data[at + 12 : end]))
        at = end
    return found, at


def latched(samples: bytes, before: int = 0) -> np.ndarray:
    """The chain's outputs after the latch of each frame: bit n is output n, output 0 that of the
    chip's first stage.

    samples: 16-bit stereo, left and right, lowest byte first. before: the last 17 bits that were
    sent before it, the last of them lowest.
    """
    frames = np.frombuffer(samples, "<u2").astype(">u2")
    sent = np.unpackbits(frames.view("u1"))
    # the wire is a clock late: a latch sees the bits up to the one before the 16th of its frame
    head = [before >> bit & 1 for bit in range(_HALF, -1, -1)]
    wire = np.concatenate((np.array(head, "u1"), sent))
    windows = np.lib.stride_tricks.sliding_window_view(wire, BITS)[::BITS]
    weights = 1 << np.arange(BITS - 1, -1, -1, dtype=np.int64)
    return windows.astype(np.int64) @ weights


def outputs(
    buffers: list[tuple[int, bytes]], rate: int, before: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """When the chain's outputs took which word: times in ns and words, one for each frame.

    buffers: as played() gives them. rate: frames a second. before: last_bits() of what was played
    before these.
    """
    times, words = [], []
    for start, samples in buffers:
        frames = len(samples) // (BITS // 8)
        times.append(start + (np.arange(frames) * 2 + 1) * 1_000_000_000 // (2 * rate))
        words.append(latched(samples, before))
        before = last_bits(samples)
    if not times:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    return np.concatenate(times), np.concatenate(words)


def last_bits(samples: bytes) -> int:
    """The last bits of a buffer that the next one's first latch sees."""
    right, left = (int.from_bytes(samples[at:][:2], "little") for at in (-2, -4))
    return (left << _HALF | right) & (2 << _HALF) - 1


def records(times: np.ndarray, words: np.ndarray) -> np.ndarray:
    """The changes of each output as the emulator writes those of pins, for trace.PinDecoder and
    trace.Trace.from_records: the first of each output is its level before."""
    found = []
    for output in range(BITS if len(words) else 0):
        levels = words >> output & 1
        changes = np.concatenate(([0], np.flatnonzero(np.diff(levels)) + 1))
        mine = np.zeros(len(changes), RECORD)
        mine["t"], mine["pin"], mine["level"] = times[changes], output, levels[changes]
        found.append(mine)
    if not found:
        return np.zeros(0, RECORD)
    every = np.concatenate(found)
    return every[np.argsort(every["t"], kind="stable")]
