"""PIO state machines, DMA, and their interrupts."""

import numpy as np

from framestep_emulator import device_file, edge_times


def test_pio_pulses(emulator):
    """Eight state machines emit different pulse trains with exact spacing."""
    emu = emulator()
    repl = emu.repl()
    repl.exec(device_file("pulses.py"))
    emu.trace_start(range(16))
    repl.exec("for i in range(8):\n    sms[i].put(((50 + 10 * i) << 12) | ((200 - 1) << 1) | 1)\n")
    emu.advance(30)
    edges = emu.trace_stop()
    for i in range(8):
        rising = edge_times(edges, 2 * i, 1)
        falling = edge_times(edges, 2 * i, 0)[1:]  # the first record is the level at the start
        half = 50 + 10 * i
        period = (2 * half + 7) * 200  # cycles of the program at 5 MHz
        assert len(rising) == len(falling) == 200, f"machine {i}: {len(rising)} pulses"
        assert (np.diff(rising) == period).all(), (
            f"machine {i}: {np.unique(np.diff(rising))}, not {period}"
        )
        assert (falling - rising == (half + 2) * 200).all(), f"machine {i}: pulse width"
        assert (edge_times(edges, 2 * i + 1, 1) < rising[0]).all(), (
            "direction before the first step"
        )


def test_pio_programs(emulator):
    """Side-set, fractional dividers, autopull and autopush, input, flags between machines, exec."""
    emu = emulator()
    repl = emu.repl()
    repl.exec(
        "import rp2, machine, time\n"
        "from machine import Pin\n"
        "from rp2 import PIO, StateMachine, asm_pio\n"
        "@asm_pio(sideset_init=PIO.OUT_LOW)\n"
        "def square():\n"
        "    nop().side(1)[2]\n"
        "    nop().side(0)[4]\n"
        "sm = StateMachine(0, square, freq=3_000_000, sideset_base=Pin(0))\n"
    )
    emu.trace_start([0])
    repl.exec("sm.active(1); time.sleep_ms(5); sm.active(0)")
    gaps = np.diff(edge_times(emu.trace_stop(), 0, 1))
    # 125 / 3 is 41 + 170/256 in the divider: 8 of those are 333.3 cycles, so 333 or 334
    assert set(gaps) == {2664, 2672}, f"fractional divider: {np.unique(gaps)}"
    assert abs(gaps.mean() - 8 * (41 + 170 / 256) * 8) < 1, f"average {gaps.mean()}"

    repl.exec(
        "@asm_pio(sideset_init=PIO.OUT_LOW, out_shiftdir=PIO.SHIFT_LEFT, "
        "autopull=True, pull_thresh=24)\n"
        "def pixels():\n"
        "    wrap_target()\n"
        "    label('bit')\n"
        "    out(x, 1).side(0)[2]\n"
        "    jmp(not_x, 'zero').side(1)[1]\n"
        "    jmp('bit').side(1)[4]\n"
        "    label('zero')\n"
        "    nop().side(0)[4]\n"
        "    wrap()\n"
        "sm = StateMachine(1, pixels, freq=5_000_000, sideset_base=Pin(1))\n"
        "sm.active(1)\n"
    )
    emu.trace_start([1])
    repl.exec(
        "for v in (0xff00aa, 0x123456, 0x000001): sm.put(v, 8)\ntime.sleep_ms(1)\nsm.active(0)"
    )
    edges = emu.trace_stop()
    width = edge_times(edges, 1, 0)[1:] - edge_times(edges, 1, 1)
    bits = "".join("1" if w == 1400 else "0" if w == 400 else "?" for w in width)
    assert f"{int(bits, 2):x}" == "ff00aa123456000001", bits

    repl.exec(
        "@asm_pio(in_shiftdir=PIO.SHIFT_LEFT, autopush=True, push_thresh=8)\n"
        "def sampler():\n"
        "    wait(1, gpio, 8)\n"
        "    in_(pins, 4)\n"
        "    wait(0, gpio, 8)\n"
        "    in_(pins, 4)\n"
        "@asm_pio()\n"
        "def stopwatch():\n"
        "    wrap_target()\n"
        "    mov(x, invert(null))\n"
        "    wait(0, pin, 0)\n"
        "    wait(1, pin, 0)\n"
        "    label('count')\n"
        "    jmp(x_dec, 'test')\n"
        "    label('test')\n"
        "    jmp(pin, 'count')\n"
        "    mov(isr, invert(x))\n"
        "    push(noblock)\n"
        "    wrap()\n"
        "for i in range(4, 10): Pin(i, Pin.IN, Pin.PULL_DOWN)\n"
        "sampling = StateMachine(2, sampler, in_base=Pin(4))\n"
        "timing = StateMachine(3, stopwatch, freq=10_000_000, in_base=Pin(9), jmp_pin=Pin(9))\n"
        "sampling.active(1); timing.active(1)\n"
    )
    for value, clock in ((5, 1), (9, 0), (3, 1), (12, 0)):
        for i in range(4):
            emu.set_pin(4 + i, (value >> i) & 1)
        emu.set_pin(8, clock)
        emu.advance(0.1)
    assert repl.eval("(sampling.get(), sampling.get(), sampling.rx_fifo())") == (0x59, 0x3C, 0), (
        "sampler"
    )
    for us in (100, 37, 1000):
        emu.set_pin(9, 1)
        emu.advance(us / 1000)
        emu.set_pin(9, 0)
        emu.advance(0.1)
    assert repl.eval("[timing.get() for i in range(timing.rx_fifo())]") == [500, 185, 5000], (
        "stopwatch"
    )

    repl.exec(
        "@asm_pio(set_init=PIO.OUT_LOW)\n"
        "def leader():\n"
        "    set(pins, 1)[9]\n"
        "    irq(block, 4)\n"
        "    set(pins, 0)[9]\n"
        "@asm_pio(set_init=PIO.OUT_LOW)\n"
        "def follower():\n"
        "    wait(1, irq, 4)\n"
        "    set(pins, 1)[4]\n"
        "    set(pins, 0)\n"
        "a = StateMachine(4, leader, freq=1_000_000, set_base=Pin(10))\n"
        "b = StateMachine(5, follower, freq=1_000_000, set_base=Pin(11))\n"
    )
    emu.trace_start([10, 11])
    repl.exec("b.active(1); a.active(1); time.sleep_ms(1); a.active(0); b.active(0)")
    edges = emu.trace_stop()
    for pin in (10, 11):
        assert (np.diff(edge_times(edges, pin, 1)) == 22_000).all(), (
            f"flags: {np.diff(edge_times(edges, pin, 1))}"
        )

    out = repl.exec(
        "@asm_pio()\n"
        "def idle():\n"
        "    nop()\n"
        "c = StateMachine(6, idle)\n"
        "def value(*instructions):\n"
        "    for i in instructions: c.exec(i)\n"
        "    c.exec('push()')\n"
        "    return c.get()\n"
        "c.put(0x80000003)\n"
        "c.exec('pull()')\n"
        "print(hex(value('mov(x, reverse(osr))', 'mov(isr, x)')), "
        "hex(value('set(y, 21)', 'mov(isr, invert(y))')))\n"
        "c.put(0x12345678)\n"
        "print(hex(value('pull()', 'out(x, 8)', 'mov(isr, x)')), "
        "value('set(x, 3)', 0x0040, 'in_(x, 32)'))\n"
    )
    assert out.split() == ["0xc0000001", "0xffffffea", "0x12", "2"], out


def test_dma_and_pio_irq(emulator):
    """rp2.DMA to memory, to a PIO FIFO and paced by a timer; PIO interrupts with hard handlers."""
    emu = emulator()
    repl = emu.repl()
    out = repl.exec(
        "import rp2, array, machine, time\n"
        "source = bytes(range(256)) * 4; target = bytearray(1024); hits = []\n"
        "d = rp2.DMA()\n"
        "d.irq(lambda x: hits.append(1), hard=False)\n"
        "c = d.pack_ctrl(size=2, irq_quiet=False)\n"
        "d.config(read=source, write=target, count=256, ctrl=c, trigger=True)\n"
        "while d.active(): pass\n"
        "time.sleep_ms(1)\n"
        "print(source == target, hits)\n"
    )
    assert out.strip() == "True [1]", out
    repl.exec(
        "@rp2.asm_pio(out_init=rp2.PIO.OUT_LOW, autopull=True, pull_thresh=32, "
        "fifo_join=rp2.PIO.JOIN_TX)\n"
        "def shifter():\n"
        "    out(pins, 1)\n"
        "sm = rp2.StateMachine(0, shifter, freq=1_000_000, out_base=machine.Pin(6))\n"
        "words = array.array('I', [0xaaaaaaaa] * 32)\n"
        "d.config(read=words, write=sm, count=32, "
        "ctrl=d.pack_ctrl(size=2, inc_write=False, treq_sel=0))\n"
    )
    emu.trace_start([6])
    repl.exec("d.active(1); sm.active(1); time.sleep_ms(3); sm.active(0)")
    gaps = np.diff(edge_times(emu.trace_stop(), 6)[1:])
    assert len(gaps) >= 1020, f"DMA to PIO: {np.unique(gaps, return_counts=True)}"
    assert (gaps == 1000).all(), f"DMA to PIO: {np.unique(gaps, return_counts=True)}"
    repl.exec(
        "machine.mem32[0x50000420] = (1 << 16) | 12500\n"  # DMA timer 0: clk_sys / 12500 = 10 kHz
        "machine.Pin(7, machine.Pin.OUT)\n"
        "ones = array.array('I', [1 << 7] * 40)\n"
        "e = rp2.DMA()\n"
        "e.config(read=ones, write=0xd000001c, count=40, "
        "ctrl=e.pack_ctrl(size=2, inc_write=False, treq_sel=0x3b))\n"
    )
    emu.trace_start([7])
    repl.exec("e.active(1); time.sleep_ms(5)")
    gaps = np.diff(edge_times(emu.trace_stop(), 7)[1:])
    assert len(gaps) == 39, f"timer-paced DMA: {gaps}"
    assert (gaps == 100_000).all(), f"timer-paced DMA: {gaps}"

    repl.exec(
        "import micropython\n"
        "@rp2.asm_pio()\n"
        "def ticker():\n"
        "    set(x, 31)\n"
        "    label('loop')\n"
        "    nop()[31]\n"
        "    jmp(x_dec, 'loop')[29]\n"
        "    irq(rel(0))\n"
        "led = machine.Pin(8, machine.Pin.OUT)\n"
        "tick = rp2.StateMachine(4, ticker, freq=2_000_000)\n"
        "@micropython.viper\n"
        "def handler(sm):\n"
        "    ptr32(0xd000001c)[0] = 256\n"
        "tick.irq(handler, hard=True)\n"
    )
    emu.trace_start([8])
    with emu.measure() as m:
        repl.exec("tick.active(1); time.sleep_ms(50); tick.active(0)")
    gaps = np.diff(edge_times(emu.trace_stop(), 8)[2:])
    assert len(gaps) > 40, f"PIO irq: {gaps}"
    assert abs(gaps - np.median(gaps)).max() < 5000, f"PIO irq: {gaps}"
    irq = m["exceptions"]["irq9"]
    assert irq["count"] >= len(gaps), irq
    assert 600 < irq["cycles"] / irq["count"] < 1200, irq


def test_a_loop_that_counts_until_a_pin_changes(emulator):
    """The emulator skips through such a loop; it executes the same loop word by word if that has a
    side-set without effect. Both count the same."""
    repl = emulator().repl()
    repl.exec(
        "import rp2, time\n"
        "from machine import Pin, PWM, mem32\n"
        "@rp2.asm_pio(fifo_join=rp2.PIO.JOIN_RX)\n"
        "def stamps():\n"
        "    label('rise')\n"
        "    mov(isr, x)\n"
        "    push(noblock)\n"
        "    label('high')\n"
        "    jmp(x_dec, 'look_high')\n"
        "    label('look_high')\n"
        "    jmp(pin, 'high')\n"
        "    mov(isr, x)\n"
        "    push(noblock)\n"
        "    wrap_target()\n"
        "    jmp(x_dec, 'look_low')\n"
        "    label('look_low')\n"
        "    jmp(pin, 'rise')\n"
        "    wrap()\n"
        "pwm = PWM(Pin(5), freq=7919, duty_u16=20011)\n"
        "sms = [rp2.StateMachine(i, stamps, in_base=Pin(5), jmp_pin=Pin(5)) for i in range(2)]\n"
        "for sm in sms: sm.exec('mov(x, invert(null))')\n"
        "mem32[0x502000CC + 24] |= 1 << 30  # EXECCTRL: side-set is optional ...\n"
        "mem32[0x502000DC + 24] |= 1 << 29  # PINCTRL: ... and has one bit\n"
        "mem32[0x50202000] = 3\n"
        "time.sleep_ms(3)\n"
    )
    counts = np.array(
        [repl.eval(f"[sms[{i}].get() for _ in range(8)]") for i in range(2)], np.int64
    )
    assert (np.diff(counts[0])[1:] < -1000).all()  # the first count is as after an edge
    assert np.abs(counts[0] - counts[1]).max() <= 1
