"""A chain of 74HC595 shift registers behind an ESP32's I2S: levels of its outputs from played data.

I2S sends 16-bit stereo in Philips format. Each frame has 16 bits of the left sample while WS is low
and 16 bits of the right one while WS is high, highest bit first, each one clock later than WS. SCK
is the chain's clock, SD its data. At the rising edge of WS its outputs take the bits shifted in so
far. So they change once a frame, in the middle of it.
"""

import os

import numpy as np

from ..errors import ToolError

BITS = 32  # in a frame, and number of outputs
RECORD = np.dtype([("t", "u8"), ("pin", "u1"), ("level", "u1")])
_HALF = BITS // 2


class ChainError(ToolError):
    """A record of played words is invalid."""


def played(path: str | os.PathLike[str]) -> list[tuple[int, bytes]]:
    """Read the DMA buffers in a record of the simulated chip (tools/micropython/esp32/i2s.c): the
    time in ns at which each began to play, and its bytes. Raises ChainError if it is cut off."""
    with open(path, "rb") as file:
        data = file.read()
    found, end = buffers(data)
    if end != len(data):
        raise ChainError(f"{path}: ends within a buffer")
    return found


def buffers(data: bytes) -> tuple[list[tuple[int, bytes]], int]:
    """Parse the buffers in a piece of a record. Also return where the last whole buffer ends."""
    found, at = [], 0
    while at + 12 <= len(data):
        end = at + 12 + int.from_bytes(data[at + 8 : at + 12], "little")
        if end > len(data):
            break
        found.append((int.from_bytes(data[at : at + 8], "little"), data[at + 12 : end]))
        at = end
    return found, at


def outputs(
    buffers: list[tuple[int, bytes]], rate: int, before: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Return the outputs' words after the latch of each frame, and the times of the latches in ns.
    Bit n of a word is output n, output 0 is the first stage of the chip.

    buffers: from played(); rate: frames a second; before: last_bits() of the previous buffer.
    """
    if not buffers:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    counts = np.array([len(samples) // (BITS // 8) for _, samples in buffers])
    starts = np.array([start for start, _ in buffers])
    place = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    times = np.repeat(starts, counts) + (place * 2 + 1) * 1_000_000_000 // (2 * rate)
    samples = np.frombuffer(b"".join(samples for _, samples in buffers), "<u2").astype(np.int64)
    left, right = samples[::2], samples[1::2]
    # The wire is one clock late. So a latch sees all of its frame's left sample but the last bit,
    # and before that the 17 bits of the frame before.
    earlier = np.concatenate(([before], (left & 1) << _HALF | right))[:-1]
    return times, earlier << _HALF - 1 | left >> 1


def last_bits(samples: bytes) -> int:
    """Return the last bits of a buffer, for the next one's first latch."""
    right, left = (int.from_bytes(samples[at:][:2], "little") for at in (-2, -4))
    return (left << _HALF | right) & (2 << _HALF) - 1


def records(times: np.ndarray, words: np.ndarray) -> np.ndarray:
    """Return the changes of each output in the emulator's form, for trace.PinDecoder and
    trace.Trace.from_records. The first record of each output is its level before."""
    found = []
    changed = np.concatenate((np.arange(min(len(words), 1)), np.flatnonzero(np.diff(words)) + 1))
    times, words = times[changed], words[changed]
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
