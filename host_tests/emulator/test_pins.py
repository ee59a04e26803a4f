"""Pins, PWM, ADC, UART."""

import numpy as np

from framestep_emulator import edge_times


def test_pins_pwm_adc(emulator):
    """Pulls, outside drive, pin interrupts, reading back outputs, PWM and ADC."""
    emu = emulator()
    repl = emu.repl()
    repl.exec(
        "import machine, time, array\n"
        "a = machine.Pin(10, machine.Pin.IN, machine.Pin.PULL_UP)\n"
        "b = machine.Pin(11, machine.Pin.IN, machine.Pin.PULL_DOWN)\n"
        "o = machine.Pin(12, machine.Pin.OUT, value=1)\n"
        "hits = array.array('I', [0])\n"
        "def hit(p):\n"
        "    hits[0] += 1\n"
        "a.irq(hit, machine.Pin.IRQ_FALLING, hard=True)\n"
    )
    assert repl.eval("(a.value(), b.value(), o.value())") == (1, 0, 1), "idle levels"
    for level in (0, 1, 0, None, None):
        emu.set_pin(10, level)
        emu.advance(1)
    emu.set_pin(11, 1)
    assert repl.eval("(a.value(), b.value(), hits[0])") == (1, 1, 2), (
        "pull-up, outside drive, interrupts"
    )
    emu.trace_start([13])
    repl.exec("p = machine.PWM(machine.Pin(13), freq=1000, duty_u16=16384); time.sleep_ms(20)")
    edges = emu.trace_stop()
    rising = edge_times(edges, 13, 1)[1:]
    width = edge_times(edges, 13, 0)[-10:] - rising[-10:]
    assert abs(np.diff(rising) - 1e6).max() < 1000, "PWM"
    assert abs(width - 250_000).max() < 1000, "PWM"
    emu.cmd("adc", channel=1, value=2048)
    assert abs(repl.eval("machine.ADC(27).read_u16()") - 32776) < 20, "ADC"


def test_uart_dmx(emulator):
    """UART1 at 250000 8N2: break, bytes with their times, and the line itself."""
    emu = emulator()
    repl = emu.repl()
    repl.exec(
        "from machine import UART, Pin\n"
        "u = UART(1, baudrate=250000, bits=8, parity=None, stop=2, "
        "tx=Pin(4), rx=Pin(5), txbuf=1024)\n"
        "frame = bytes([0]) + bytes(range(256)) * 2\n"
    )
    emu.uart_start(1)
    emu.trace_start([4])
    repl.exec("u.sendbreak(); u.write(frame); u.flush()")
    data, breaks = emu.uart_read(1)
    edges = emu.trace_stop()
    assert [value for _, value in data] == [0] + list(range(256)) * 2, "bytes"
    assert (np.diff([t for t, _ in data]) == 44_000).all(), "11 bits of 4 us each"
    assert len(breaks) == 1, f"{breaks}"
    low = edge_times(edges, 4, 0)
    high = edge_times(edges, 4, 1)
    assert breaks[0] == [int(low[0]), int(high[high > low[0]][0])], "the break on the line"
    emu.uart_send(1, b"incoming")
    assert "incoming" in repl.exec("import time; time.sleep_ms(2); print(u.read())"), "RX"
