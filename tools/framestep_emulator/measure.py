"""Measures what the emulated board can do and how fast it is emulated: figures for README.md.

python -m framestep_emulator.measure --pico FIRMWARE --pico2 FIRMWARE --benchmarks FOLDER [NAME ...]
gives MicroPython's images for both boards and its tests/perf_bench. Without names it measures all.
"""

import argparse
import contextlib
import math
import time
from pathlib import Path

import numpy as np

from . import Emulator, EmulatorError, ReplError, device_file, edge_times


def say(text):
    print(f"    {text}", flush=True)


def emulation_speed(given):
    for name, firmware in (("Pico", given.pico), ("Pico 2", given.pico2)):
        say(f"{name}:")
        _speed_of(firmware)


def _speed_of(firmware):
    with Emulator(firmware) as emu:
        repl = emu.repl()

        def ratio(before, after):
            """Return the speed by processor time: other programs do not count."""
            return (after["ns"] - before["ns"]) / 1e6 / (after["cpu_ms"] - before["cpu_ms"])

        started = ratio({"ns": 0, "cpu_ms": 0}, emu.cmd("time"))
        say(f"{'start, up to the prompt':44} {started:8.2f} x real time")

        def speed(label, code, advance_ms):
            repl.start(code)
            emu.advance(5)
            before = emu.cmd("time")
            emu.advance(advance_ms)
            after = emu.cmd("time")
            say(f"{label:44} {ratio(before, after):8.2f} x real time")
            repl.serial.write(b"\x03")
            with contextlib.suppress(ReplError, EmulatorError):
                repl.finish(5)

        speed("idle in time.sleep", "import time\ntime.sleep(100)", 20000)
        speed("bytecode loop", "x = 0\nwhile True:\n    x = (x + 1) & 0xffff", 3000)
        speed(
            "viper loop",
            "import micropython\n"
            "@micropython.viper\n"
            "def f(n: int):\n"
            "    i = 0\n"
            "    while i < n:\n"
            "        i += 1\n"
            "while True: f(100000)",
            2000,
        )
        speed(
            "allocating, with garbage collection",
            "while True:\n    x = [i for i in range(500)]",
            2000,
        )
        repl.exec(device_file("pulses.py"))
        words = "[((22 << 12) | (1999 << 1) | 1) for i in range(4)]"
        repl.exec(f"for sm in sms:\n    for w in {words}:\n        sm.put(w)\n")
        before = emu.cmd("time")
        emu.trace_start(range(16))
        emu.advance(70)
        after = emu.cmd("time")
        edges = len(emu.trace_stop())
        say(
            f"{'8 PIO step generators at 98 kHz, traced':44} "
            f"{ratio(before, after):8.2f} x real time ({edges} edges in 70 ms)"
        )


TIMING = """
import time, gc, machine, micropython, array
from micropython import const
def report(name, f, n=200):
    f(); gc.collect()
    t = time.ticks_us()
    for _ in range(n):
        f()
    t = time.ticks_diff(time.ticks_us(), t)
    e = time.ticks_us()
    for _ in range(n):
        nothing()
    e = time.ticks_diff(time.ticks_us(), e)
    print('%-44s %9.2f us' % (name, (t - e) / n))
def nothing(): pass
"""


def interpreter_costs(given):
    with Emulator(given.pico) as emu:
        repl = emu.repl()
        repl.exec(TIMING)
        print(
            repl.exec(
                "def loop():\n"
                "    for i in range(10000): pass\n"
                "def wloop():\n"
                "    i = 0\n"
                "    while i < 10000: i += 1\n"
                "report('for loop, 10000 iterations', loop, 3)\n"
                "report('while loop with i += 1, 10000 iterations', wloop, 3)\n"
                "def c(): time.ticks_us()\n"
                "report('time.ticks_us() with lookups', c)\n"
                "us = time.ticks_us\n"
                "def c(): us()\n"
                "report('ticks_us, held in a global', c)\n"
                "def c(): time.ticks_ms()\n"
                "report('time.ticks_ms() with lookups', c)\n"
                "class P:\n"
                "    def __init__(self): self.x = 1\n"
                "    def m(self): pass\n"
                "p = P()\n"
                "def c(): p.m()\n"
                "report('method call', c)\n"
                "def c(): p.x = p.x + 1\n"
                "report('attribute read, add, store', c)\n"
                "a = array.array('i', [0] * 8)\n"
                "def c(): a[3] = a[3] + 1\n"
                "report('array element read, add, store', c)\n"
                "pin = machine.Pin(3, machine.Pin.OUT)\n"
                "def c(): pin.value(1)\n"
                "report('pin.value(1)', c)\n"
                "def c(): pin.toggle()\n"
                "report('pin.toggle()', c)\n"
                "def c(): return 1.5 * 2.5 + 3.5\n"
                "x = 1.5\n"
                "def c(): x * x\n"
                "report('float multiply, globals', c)\n"
                "import math\n"
                "def c(): math.sqrt(x)\n"
                "report('math.sqrt', c)\n"
                "def c(): math.sin(x)\n"
                "report('math.sin', c)\n"
                "@micropython.viper\n"
                "def v(): pass\n"
                "def c(): v()\n"
                "report('viper call', c)\n"
                "@micropython.viper\n"
                "def vw():\n"
                "    p = ptr32(0xd0000014)\n"
                "    i = 0\n"
                "    while i < 1000:\n"
                "        p[0] = 8\n"
                "        i += 1\n"
                "report('viper loop, 1000 register writes', vw, 5)\n"
                "import struct\n"
                "b = bytearray(16)\n"
                "def c(): struct.pack_into('<IhhI', b, 0, 1, 2, 3, 4)\n"
                "report('struct.pack_into of four values', c)\n"
                "import gc\n"
                "gc.collect()\n"
                "t = time.ticks_us(); gc.collect(); t = time.ticks_diff(time.ticks_us(), t)\n"
                "print('%-44s %9.2f us' % ('gc.collect(), almost empty heap', t))\n"
                "objects = [bytearray(16) for i in range(3000)]\n"
                "t = time.ticks_us(); gc.collect(); t = time.ticks_diff(time.ticks_us(), t)\n"
                "print('%-44s %9.2f us' % ('gc.collect() with 3000 objects', t), "
                "gc.mem_free(), 'bytes free')\n"
            ).rstrip()
        )


# Scores of real boards in MicroPython's own benchmarks; higher is faster.
# A Pico at 125 MHz: MicroPython's pull request 12846 (2023, N=100 M=100). Its firmware was older,
# with the boot ROM's sin and cos, which shows in bm_float.
PICO_SCORES = {
    "bm_chaos": 213.40,
    "bm_fannkuch": 55.57,
    "bm_fft": 1581.21,
    "bm_float": 3769.89,
    "bm_hexiom": 37.17,
    "bm_nqueens": 2594.77,
    "bm_pidigits": 381.45,
    "bm_wordcount": 37.86,
    "core_import_mpy_multi": 310.81,
    "core_import_mpy_single": 59.40,
    "core_locals": 28.30,
    "core_qstr": 137.20,
    "core_str": 19.12,
}
# A Pico 2 at 150 MHz: pull request 19352 (2026, N=168 M=100), the column before its change.
PICO2_SCORES = {
    "bm_chaos": 307.38,
    "bm_fannkuch": 92.60,
    "bm_fft": 2989.25,
    "bm_float": 4833.23,
    "bm_hexiom": 43.77,
    "bm_nqueens": 3708.24,
    "bm_pidigits": 773.64,
}


def timing_against_real_boards(given):
    """Compare MicroPython's performance benchmarks with published scores of real boards."""
    folder = given.benchmarks
    bench_run = (folder / "benchrun.py").read_text()
    for board, firmware, scores, mhz in (
        ("Pico", given.pico, PICO_SCORES, 100),
        ("Pico 2", given.pico2, PICO2_SCORES, 168),
    ):
        for cache in (True, False):
            ratios = []
            for name, real in scores.items():
                script = (folder / (name + ".py")).read_text()
                args = [] if cache else ["--xip-miss", "0"]
                with Emulator(firmware, args=args) as emu:
                    found = emu.repl().exec(f"{script}\n{bench_run}\nbm_run({mhz}, 100)\n")
                us, norm, _ = found.split(None, 2)
                ratios.append(int(norm) * 1e6 / int(us) / real)
            mean = math.exp(sum(map(math.log, ratios)) / len(ratios))
            each = ", ".join(
                f"{name} {ratio:.2f}" for name, ratio in zip(scores, ratios, strict=True)
            )
            say(
                f"{board}, cache misses {'take their time' if cache else 'take no time'}: "
                f"speed relative to a real one {mean:.2f} on average ({each})"
            )


def interrupt_costs(given):
    with Emulator(given.pico) as emu:
        repl = emu.repl()
        repl.exec(
            "import machine, micropython, time\n"
            "@micropython.viper\n"
            "def empty(t): pass\n"
            "@micropython.viper\n"
            "def toggle(t):\n"
            "    ptr32(0xd000001c)[0] = 4\n"
            "count = 0\n"
            "def bytecode(t):\n"
            "    global count\n"
            "    count += 1\n"
            "def busy(ms):\n"
            "    t = time.ticks_ms()\n"
            "    while time.ticks_diff(time.ticks_ms(), t) < ms: pass\n"
        )
        for name in ("empty", "toggle", "bytecode"):
            for rate, work in (
                (1000, "time.sleep_ms(200)"),
                (1000, "busy(200)"),
                (5000, "busy(200)"),
            ):
                with emu.measure() as m:
                    repl.exec(
                        f"t = machine.Timer(-1, freq={rate}, callback={name}, hard=True)\n"
                        f"{work}\n"
                        "t.deinit()"
                    )
                irq = m["exceptions"]["irq3"]
                mean = irq["cycles"] / irq["count"]
                say(
                    f"hard Timer {rate} Hz, {name:8} {work[:5]:5}: "
                    f"{mean:6.0f} cycles = {mean / 125:5.2f} us each, "
                    f"worst {irq['max'] / 125:.1f} us, {100 * mean * rate / 125e6:.1f} % of the CPU"
                )
        # effect of a write to the flash on a 1 kHz interrupt
        repl.exec("machine.Pin(2, machine.Pin.OUT)")
        emu.trace_start([2])
        repl.exec(
            "t = machine.Timer(-1, freq=1000, callback=toggle, hard=True)\n"
            "f = open('x', 'w'); f.write('y' * 5000); f.close()\n"
            "t.deinit()\n",
        )
        gaps = np.diff(edge_times(emu.trace_stop(), 2)[1:])
        say(f"writing a 5 KB file: longest gap between 1 ms interrupts {gaps.max() / 1e6:.1f} ms")


BLOCK = bytes(i & 0xFF for i in range(1036))


def send_blocks(emu, repl, name, code, count, remark):
    """Run code on the board that takes `count` blocks and prints how many microseconds that
    took."""
    repl.start(
        "import sys, select, micropython, time\n"
        "micropython.kbd_intr(-1)\n"
        "poll = select.poll(); poll.register(sys.stdin, select.POLLIN)\n"
        "b = bytearray(1036)\n" + code,
        until="ready",
    )
    for _ in range(count):
        repl.serial.write(BLOCK)
    with emu.measure() as m:
        us = int(repl.finish(120).split()[0])
    each = us / (count * len(BLOCK))
    say(
        f"{name:52} {1000 / each:7.1f} kB/s = {each:6.2f} us/byte, "
        f"{remark}, load {100 * m['load']:.0f} %"
    )


def serial_throughput(given):
    blocks = 100
    few = 5
    readinto = (
        "r = sys.stdin.buffer.readinto\n"
        "print('ready')\n"
        "r(b); t = time.ticks_us()\n"
        f"for i in range({blocks - 1}): r(b)\n"
        f"print(time.ticks_diff(time.ticks_us(), t) * {blocks} // {blocks - 1})\n"
    )
    with Emulator(given.pico) as emu:
        repl = emu.repl()
        send_blocks(
            emu, repl, "stdin.buffer.readinto, 1036-byte blocks", readinto, blocks, "blocking"
        )
        send_blocks(
            emu,
            repl,
            "poll(0), then readinto of header and payload",
            "r = sys.stdin.buffer.readinto; h = bytearray(12); m = memoryview(b)[12:]; "
            "p = poll.poll\n"
            "t = 0; n = 0\n"
            "print('ready')\n"
            f"while n < {blocks}:\n"
            "    if p(0):\n"
            "        r(h); r(m); n += 1\n"
            "        if n == 1: t = time.ticks_us()\n"
            f"print(time.ticks_diff(time.ticks_us(), t) * {blocks} // {blocks - 1})\n",
            blocks,
            "not blocking between blocks",
        )
        send_blocks(
            emu,
            repl,
            "poll(0) + read(1)",
            "def f(n):\n"
            "    r = sys.stdin.buffer.read; p = poll.poll\n"
            "    i = 0\n"
            "    print('ready')\n"
            "    while not p(0): pass\n"
            "    t = time.ticks_us()\n"
            "    while i < n:\n"
            "        if p(0):\n"
            "            r(1); i += 1\n"
            "    print(time.ticks_diff(time.ticks_us(), t))\n"
            f"f({few * len(BLOCK)})\n",
            few,
            "never blocking",
        )
        send_blocks(
            emu,
            repl,
            "ipoll(0) + readinto of a 1-byte view, native code",
            "@micropython.native\n"
            "def f(n):\n"
            "    r = sys.stdin.buffer.readinto; p = poll.ipoll; v = bytearray(1)\n"
            "    i = 0\n"
            "    print('ready')\n"
            "    while not p(0): pass\n"
            "    t = time.ticks_us()\n"
            "    while i < n:\n"
            "        for x in p(0):\n"
            "            r(v); i += 1\n"
            "    print(time.ticks_diff(time.ticks_us(), t))\n"
            f"f({few * len(BLOCK)})\n",
            few,
            "never blocking",
        )
    with Emulator(given.pico, args=["--xip-miss", "0"]) as emu:
        send_blocks(
            emu, emu.repl(), "the first one, without cache misses", readinto, blocks, "blocking"
        )
    with Emulator(given.pico, files={"/cdc2.py": device_file("cdc2.py")}) as emu:
        repl = emu.repl()
        repl.exec(
            "import cdc2\n"
            "total = 0\n"
            "def on_rx(p, n):\n"
            "    global total\n"
            "    total += n\n"
            "port = cdc2.CDC2(on_rx)"
        )
        start = emu.ns
        repl.serial.write(b"port.start()\x04")
        emu.wait_usb(after=start, ports=2)
        emu.advance(20)
        second = emu.serial(1)
        for _ in range(200):
            second.write(BLOCK)
        start = emu.ns
        with emu.measure() as m:
            second.flush()
        rate = 200 * len(BLOCK) / (emu.ns - start) * 1e9
        name = "second CDC, machine.USBDevice, 1036-byte transfers"
        say(
            f"{name:52} {rate / 1000:7.1f} kB/s, one callback a block, load {100 * m['load']:.0f} %"
        )
        repl = emu.repl()
        repl.start(
            "import sys\nd = bytes(1024)\nfor i in range(100): n = sys.stdout.buffer.write(d)\n"
        )
        start = emu.ns
        repl.serial.timeout = 10
        repl.serial.read(100 * 1024)
        rate = 100 * 1024 / (emu.ns - start) * 1e9
        say(f"{'stdout.buffer.write, 1 KB blocks':52} {rate / 1000:7.1f} kB/s")
        repl.finish()


MEASUREMENTS = {
    function.__name__: function
    for function in (
        emulation_speed,
        interpreter_costs,
        timing_against_real_boards,
        interrupt_costs,
        serial_throughput,
    )
}


def main():
    parser = argparse.ArgumentParser(prog="python -m framestep_emulator.measure")
    parser.add_argument("--pico", type=Path, required=True, help="MicroPython for a Pico")
    parser.add_argument("--pico2", type=Path, required=True, help="MicroPython for a Pico 2")
    parser.add_argument("--benchmarks", type=Path, required=True, help="its tests/perf_bench")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(MEASUREMENTS))
    given = parser.parse_args()
    if unknown := sorted({*given.names} - {*MEASUREMENTS}):
        parser.error(f"no measurement {', '.join(unknown)}; there are: {', '.join(MEASUREMENTS)}")
    for name in given.names or MEASUREMENTS:
        print(name, flush=True)
        begun = time.monotonic()
        MEASUREMENTS[name](given)
        print(f"  {time.monotonic() - begun:.1f} s", flush=True)


if __name__ == "__main__":
    main()
