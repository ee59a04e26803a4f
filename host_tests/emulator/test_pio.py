"""PIO state machines, DMA, and their interrupts."""

import numpy as np
import pytest

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


PIO = "import rp2, machine, array, time\nfrom machine import Pin\nfrom rp2 import PIO, asm_pio\n"


@pytest.fixture
def emu(emulator):
    """A board on whose REPL programs for the PIO can be written."""
    emu = emulator()
    emu.repl().exec(PIO)
    return emu


def gaps_between_edges(emu, pin, code, level=None):
    """Run code; return the gaps between the pin's edges (to that level) in ns."""
    emu.trace_start([pin])
    emu.repl().exec(code)
    return np.diff(edge_times(emu.trace_stop(), pin, level)[0 if level else 1 :])


def test_a_divider_of_a_fraction_makes_a_period_of_two_lengths(emu):
    emu.repl().exec(
        "@asm_pio(sideset_init=PIO.OUT_LOW)\n"
        "def square():\n"
        "    nop().side(1)[2]\n"
        "    nop().side(0)[4]\n"
        "sm = rp2.StateMachine(0, square, freq=3_000_000, sideset_base=Pin(0))\n"
    )
    gaps = gaps_between_edges(emu, 0, "sm.active(1); time.sleep_ms(5); sm.active(0)", level=1)
    # 125 / 3 is 41 + 170/256 in the divider: 8 of those are 333.3 cycles, so 333 or 334
    assert set(gaps) == {2664, 2672}
    assert gaps.mean() == pytest.approx(8 * (41 + 170 / 256) * 8, abs=1)


def test_words_leave_by_autopull_as_wide_and_narrow_pulses(emu):
    repl = emu.repl()
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
        "sm = rp2.StateMachine(1, pixels, freq=5_000_000, sideset_base=Pin(1))\n"
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


def test_pins_are_sampled_at_both_edges_of_a_clock(emu):
    repl = emu.repl()
    repl.exec(
        "@asm_pio(in_shiftdir=PIO.SHIFT_LEFT, autopush=True, push_thresh=8)\n"
        "def sampler():\n"
        "    wait(1, gpio, 8)\n"
        "    in_(pins, 4)\n"
        "    wait(0, gpio, 8)\n"
        "    in_(pins, 4)\n"
        "for i in range(4, 9): Pin(i, Pin.IN, Pin.PULL_DOWN)\n"
        "sm = rp2.StateMachine(2, sampler, in_base=Pin(4))\n"
        "sm.active(1)\n"
    )
    for value, clock in ((5, 1), (9, 0), (3, 1), (12, 0)):
        for i in range(4):
            emu.set_pin(4 + i, (value >> i) & 1)
        emu.set_pin(8, clock)
        emu.advance(0.1)
    assert repl.eval("(sm.get(), sm.get(), sm.rx_fifo())") == (0x59, 0x3C, 0)


def test_pulses_on_a_pin_are_measured(emu):
    repl = emu.repl()
    repl.exec(
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
        "Pin(9, Pin.IN, Pin.PULL_DOWN)\n"
        "sm = rp2.StateMachine(3, stopwatch, freq=10_000_000, in_base=Pin(9), jmp_pin=Pin(9))\n"
        "sm.active(1)\n"
    )
    for us in (100, 37, 1000):
        emu.set_pin(9, 1)
        emu.advance(us / 1000)
        emu.set_pin(9, 0)
        emu.advance(0.1)
    counts = repl.eval("[sm.get() for i in range(sm.rx_fifo())]")
    assert counts == [500, 185, 5000]  # of 0.2 us


def test_a_flag_holds_two_machines_in_step(emu):
    emu.repl().exec(
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
        "a = rp2.StateMachine(4, leader, freq=1_000_000, set_base=Pin(10))\n"
        "b = rp2.StateMachine(5, follower, freq=1_000_000, set_base=Pin(11))\n"
    )
    emu.trace_start([10, 11])
    emu.repl().exec("b.active(1); a.active(1); time.sleep_ms(1); a.active(0); b.active(0)")
    edges = emu.trace_stop()
    assert set(np.diff(edge_times(edges, 10, 1))) == {22_000}
    assert set(np.diff(edge_times(edges, 11, 1))) == {22_000}


@pytest.mark.parametrize(
    ("word", "instructions", "pushed"),
    [
        (0x80000003, "'pull()', 'mov(x, reverse(osr))', 'mov(isr, x)'", 0xC0000001),
        (None, "'set(y, 21)', 'mov(isr, invert(y))'", 0xFFFFFFEA),
        (0x12345678, "'pull()', 'out(x, 8)', 'mov(isr, x)'", 0x12),
        (None, "'set(x, 3)', 0x0040, 'in_(x, 32)'", 2),
    ],
)
def test_single_instructions_are_executed(emu, word, instructions, pushed):
    repl = emu.repl()
    repl.exec("@asm_pio()\ndef idle():\n    nop()\nsm = rp2.StateMachine(6, idle)\n")
    if word is not None:
        repl.exec(f"sm.put({word})")
    repl.exec(f"for each in ({instructions}, 'push()'): sm.exec(each)")
    assert hex(repl.eval("sm.get()")) == hex(pushed)


def test_a_dma_copies_memory_and_says_so_once(emu):
    out = emu.repl().exec(
        "source = bytes(range(256)) * 4; target = bytearray(1024); hits = []\n"
        "d = rp2.DMA()\n"
        "d.irq(lambda x: hits.append(1), hard=False)\n"
        "c = d.pack_ctrl(size=2, irq_quiet=False)\n"
        "d.config(read=source, write=target, count=256, ctrl=c, trigger=True)\n"
        "while d.active(): pass\n"
        "time.sleep_ms(1)\n"
        "print(source == target, hits)\n"
    )
    assert out.strip() == "True [1]"


def test_a_dma_feeds_a_machine_without_a_gap(emu):
    emu.repl().exec(
        "@asm_pio(out_init=PIO.OUT_LOW, autopull=True, pull_thresh=32, fifo_join=PIO.JOIN_TX)\n"
        "def shifter():\n"
        "    out(pins, 1)\n"
        "sm = rp2.StateMachine(0, shifter, freq=1_000_000, out_base=Pin(6))\n"
        "words = array.array('I', [0xaaaaaaaa] * 32)\n"
        "d = rp2.DMA()\n"
        "d.config(read=words, write=sm, count=32, "
        "ctrl=d.pack_ctrl(size=2, inc_write=False, treq_sel=0))\n"
    )
    gaps = gaps_between_edges(emu, 6, "d.active(1); sm.active(1); time.sleep_ms(3); sm.active(0)")
    assert len(gaps) >= 1020
    assert set(gaps) == {1000}


def test_a_timer_paces_a_dma(emu):
    emu.repl().exec(
        "machine.mem32[0x50000420] = (1 << 16) | 12500\n"  # DMA timer 0: clk_sys / 12500 = 10 kHz
        "Pin(7, Pin.OUT)\n"
        "ones = array.array('I', [1 << 7] * 40)\n"
        "d = rp2.DMA()\n"
        "d.config(read=ones, write=0xd000001c, count=40, "
        "ctrl=d.pack_ctrl(size=2, inc_write=False, treq_sel=0x3b))\n"
    )
    gaps = gaps_between_edges(emu, 7, "d.active(1); time.sleep_ms(5)")
    assert list(gaps) == [100_000] * 39


def test_a_machine_interrupts_at_equal_times(emu):
    """A hard handler answers each interrupt within 5 µs of the usual delay."""
    emu.repl().exec(
        "import micropython\n"
        "@asm_pio()\n"
        "def ticker():\n"
        "    set(x, 31)\n"
        "    label('loop')\n"
        "    nop()[31]\n"
        "    jmp(x_dec, 'loop')[29]\n"
        "    irq(rel(0))\n"
        "led = Pin(8, Pin.OUT)\n"
        "tick = rp2.StateMachine(4, ticker, freq=2_000_000)\n"
        "@micropython.viper\n"
        "def handler(sm):\n"
        "    ptr32(0xd000001c)[0] = 256\n"
        "tick.irq(handler, hard=True)\n"
    )
    with emu.measure() as m:
        gaps = gaps_between_edges(emu, 8, "tick.active(1); time.sleep_ms(50); tick.active(0)")[1:]
    assert len(gaps) > 40
    assert abs(gaps - np.median(gaps)).max() < 5000
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
