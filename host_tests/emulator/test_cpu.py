"""The processor: instructions against QEMU and rp2040js' own core, and the boot ROM's float
library."""

import math
import random
import struct
import subprocess

import numpy as np
import pytest

RUNS = 100_000
BLOCKS = 600  # for which test/pieces.mjs has a record


def test_instructions_agree_with_rp2040js(paths):
    script = paths.root / "tools/framestep_emulator/board/test/core.mjs"
    result = subprocess.run(["node", script, str(RUNS)], capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    # the script leaves out a few cases in which rp2040js departs from the architecture
    assert int(result.stdout.split()[1]) > 0.9 * RUNS


def test_instructions_agree_with_qemu(paths):
    """Instructions as the interpreter runs them, and as parts of pieces of code."""
    script = paths.root / "tools/framestep_emulator/board/test/qemu.mjs"
    result = subprocess.run(["node", script, "m0"], capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    assert result.stdout == "500 cases of 10 groups, 0 differ\n"


def test_pieces_of_code_agree_with_the_interpreter(paths):
    """Registers, flags, memory, cycles, cache and edges."""
    script = paths.root / "tools/framestep_emulator/board/test/pieces.mjs"
    command = ["node", script, str(BLOCKS), paths.rp2_firmware]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    assert result.stdout.startswith("pieces: ")


FLOAT_CODE = """
import struct, math, binascii, sys
def run(op, data):
    out = bytearray()
    for i in range(0, len(data), 8):
        a, b = struct.unpack_from('<ff', data, i)
        try:
            r = op(a, b)
            out += struct.pack('<f', r) if isinstance(r, float) else struct.pack('<i', r)
        except (ValueError, ZeroDivisionError, OverflowError):
            out += b'eeee'
    print(binascii.hexlify(out).decode())
"""

f32 = np.float32

# name: code for the board, kind of inputs, reference, allowed error in units of the last place
OPERATIONS = {
    "add": ("a + b", "any", lambda a, b: f32(a) + f32(b), 0),
    "sub": ("a - b", "any", lambda a, b: f32(a) - f32(b), 0),
    "mul": ("a * b", "any", lambda a, b: f32(a) * f32(b), 0),
    "div": ("a / b", "any", lambda a, b: f32(a) / f32(b), 0),
    "sqrt": ("math.sqrt(a)", "positive", lambda a, b: np.sqrt(f32(a)), 0),
    "int": ("int(a)", "integer", lambda a, b: int(a), 0),
    "floor": ("math.floor(a)", "integer", lambda a, b: math.floor(a), 0),
    "float(int)": ("float(int(a) * 37)", "integer", lambda a, b: f32(int(a) * 37), 0),
    "a < b": ("int(a < b)", "any", lambda a, b: int(a < b), 0),
    "sin": ("math.sin(a)", "angle", lambda a, b: math.sin(a), 3),
    "cos": ("math.cos(a)", "angle", lambda a, b: math.cos(a), 3),
    "atan2": ("math.atan2(a, b)", "angle", math.atan2, 3),
    "exp": ("math.exp(a)", "exponent", lambda a, b: math.exp(a), 3),
    "log": ("math.log(a)", "positive", lambda a, b: math.log(a), 3),
}


def float_inputs(kind, rng, n):
    def one(scale):
        (x,) = struct.unpack(
            "<f", struct.pack("<f", rng.choice([-1, 1]) * math.exp(rng.uniform(-scale, scale)))
        )
        return x

    if kind == "positive":
        return [(abs(one(20)), 1.0) for _ in range(n)]
    scale = {"any": 30, "angle": 5, "exponent": 4, "integer": 13}[kind]
    return [(one(scale), one(scale)) for _ in range(n)]


def ulps(a, b):
    def key(x):
        (bits,) = struct.unpack("<i", struct.pack("<f", x))
        return bits if bits >= 0 else -(bits & 0x7FFFFFFF)

    return abs(key(a) - key(b))


@pytest.mark.filterwarnings("ignore:overflow")
def test_floats(emulator):
    """Single-precision arithmetic is exact; the functions are within a few units of the last
    place."""
    rng = random.Random(2)
    repl = emulator().repl()
    repl.exec(FLOAT_CODE)
    for name, (code, kind, reference, limit) in OPERATIONS.items():
        inputs = float_inputs(kind, rng, 300)
        data = b"".join(struct.pack("<ff", *pair) for pair in inputs)
        out = bytes.fromhex(repl.exec(f"run(lambda a, b: {code}, {data!r})").strip())
        for i, (a, b) in enumerate(inputs):
            want = reference(a, b)
            raw = out[4 * i : 4 * i + 4]
            if isinstance(want, int):
                assert raw == struct.pack("<i", want), f"{name}({a}, {b})"
                continue
            want = float(f32(want))
            if raw == b"eeee":
                assert math.isinf(want), f"{name}({a}, {b}) raised, not {want}"
                continue
            (got,) = struct.unpack("<f", raw)
            if 0 < abs(want) < 2.0**-126:
                want = math.copysign(0.0, want)  # the boot ROM's library flushes denormals
            assert ulps(got, want) <= limit, f"{name}({a}, {b}): {got}, not {want}"
