"""A C compiler for the Xtensa processors of ESP32, ESP32-S2 and S3, made from parts of LLVM; make
calls it like gcc.

clang compiles C to bitcode, but does not know -mcpu=esp32; llc does, and makes assembler text.
mended() corrects two faults of LLVM in it, and llvm-mc makes an object file. This does not concern
framestep's kernels: mpy-cross compiles them.
"""

import os
import re
import subprocess
import sys

VERSION = os.environ.get("LLVM_VERSION", "22")
CLANG, LLC, ASSEMBLER = f"clang-{VERSION}", f"llc-{VERSION}", f"llvm-mc-{VERSION}"

TARGET = (
    *("--target=xtensa", "-Xclang", "-target-feature", "-Xclang", "+windowed"),
    *("-nostdlib", "-ffreestanding", "-fno-builtin"),
    *("-isystem", "/usr/lib/picolibc/riscv64-unknown-elf/include"),
    *("-D__XTENSA_WINDOWED_ABI__=1", "-D__PICOLIBC_ERRNO_FUNCTION=__errno_location"),
    *("-Wno-unknown-warning-option", "-Wno-unused-command-line-argument"),
)
# dc233c, QEMU's processor, lacks floating point and the upper half of a product
CODE = ("-mtriple=xtensa", "-mcpu=esp32", "-mattr=-fp,-mul32high", "-O2")
OBJECT = ("-triple=xtensa", "-mcpu=esp32", "-filetype=obj")


def run(*command: str, stdin: str | None = None) -> str:
    """Return what a command prints; if it fails, end this program with its status."""
    result = subprocess.run(command, input=stdin, stdout=subprocess.PIPE, text=True)
    if result.returncode != 0:
        sys.exit(result.returncode)
    return result.stdout


def mended(assembler: str) -> str:
    """Return llc's text without two faults of LLVM 22.

    A function with variable arguments sets its frame pointer (a7) before it saves the sixth
    argument, which is in the same register: this swaps the two. And literals are unaligned between
    functions: they get their own section.
    """
    assembler = re.sub(
        r"\tor\ta7, a1, a1\n((?:\t\.cfi[^\n]*\n)*)\ts32i\ta7, a7, (\d+)\n",
        r"\ts32i\ta7, a1, \2\n\1\tor\ta7, a1, a1\n",
        assembler,
    )
    assembler = re.sub(r"(?m)^[ \t]*\.literal_position\b.*$", "", assembler)
    return re.sub(
        r"(?m)^[ \t]*\.literal[ \t]+([^,\n]+),[ \t]*(.*)$",
        r'.pushsection .literal,"ax",@progbits'
        "\n"
        r".p2align 2"
        "\n"
        r"\1: .long \2"
        "\n"
        r".popsection",
        assembler,
    )


def main() -> None:
    arguments = sys.argv[1:]
    output = None
    if "-o" in arguments:
        at = arguments.index("-o")
        output = arguments[at + 1]
        del arguments[at : at + 2]
    if "-c" not in arguments:
        # only preprocessed, for names of strings etc.
        to = ("-o", output) if output else ()
        os.execvp(CLANG, [CLANG, *TARGET, *arguments, *to])
    if output is None:
        sys.exit("xtensa/compile.py: -c needs -o FILE")
    source = next((a for a in arguments if a.endswith((".S", ".s"))), None)
    if source is not None:
        text = run(CLANG, "--target=xtensa", "-E", "-x", "assembler-with-cpp", source)
    else:
        bitcode = output + ".bc"
        run(CLANG, *TARGET, *arguments, "-emit-llvm", "-o", bitcode)
        text = mended(run(LLC, *CODE, bitcode, "-o", "-"))
        os.unlink(bitcode)
    run(ASSEMBLER, *OBJECT, "-o", output, "-", stdin=text)


if __name__ == "__main__":
    main()
