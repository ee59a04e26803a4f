"""The simulated ESP32 under MicroPython's own bindings: which arguments they accept, and how the
chip behaves for a driver."""

import pytest

from framestep_tools.simulator import shift_registers

HEAD = """
import gc, select, sys, time
import chip
from machine import I2S, Pin, Timer

OK = dict(sck=16, ws=17, sd=21, mode=I2S.TX, bits=16, format=I2S.STEREO, rate=250000, ibuf=4096)
BUFFER = 1024  # bytes; it lasts 1024 us


def error(what, *args, **settings):
    try:
        what(*args, **settings)
    except Exception as found:
        return (type(found).__name__,) + found.args
    return "taken"


def settle():
    for _ in range(20):
        pass  # callbacks run between bytecodes, at the end of a loop


def asynchronous(**settings):
    i2s = I2S(0, **dict(OK, **settings))
    poll = select.poll()
    poll.register(i2s, select.POLLOUT)
    poll.poll(0)
    return i2s


def filled(number):
    return bytes((number,)) * BUFFER
"""


@pytest.fixture
def on_chip(chip, tmp_path):
    """Return on_chip(script), which returns the lines printed and the buffers played: (µs, first
    byte, how many bytes equal it)."""

    def run(script):
        record = tmp_path / "played"
        text = chip.run(f"{HEAD}\nchip.record({str(record)!r})\n{script}")
        heard = [
            (t // 1000, data[0], data.count(data[0])) for t, data in shift_registers.played(record)
        ]
        return text.splitlines(), heard

    return run


def values(heard):
    return [value for _, value, _ in heard]


@pytest.mark.parametrize(
    "call, wanted",
    [
        ("I2S, 0", "('TypeError', \"'sck' argument required\")"),
        ("I2S, 2, **OK", "('ValueError', 'invalid id')"),
        ("I2S, 0, **dict(OK, bits=24)", "('ValueError', 'invalid bits')"),
        ("I2S, 0, **dict(OK, mode=5)", "('ValueError', 'invalid mode')"),
        ("I2S, 0, **dict(OK, format=2)", "('ValueError', 'invalid format')"),
        ("I2S, 0, **dict(OK, sck=40)", "('ValueError', 'invalid pin')"),
        ("I2S, 0, **dict(OK, rate=314000)", "taken"),
        ("I2S, 0, **dict(OK, rate=314100)", "('OSError', -258)"),
        ("I2S, 0, **dict(OK, ibuf=10**6)", "('OSError', 12)"),
        ("Timer, 4", "('ValueError', 'invalid Timer number')"),
        ("Timer, -1", "('ValueError', 'invalid Timer number')"),
        ("Timer, 0, hard=True", "('TypeError', 'extra keyword arguments given')"),
        ("Pin, 34, Pin.OUT", "('ValueError', 'pin can only be input')"),
        ("Pin(4).irq, print, hard=True", "('TypeError', 'extra keyword arguments given')"),
    ],
)
def test_arguments_are_those_of_the_port(on_chip, call, wanted):
    assert on_chip(f"print(error({call}))")[0] == [wanted]


def test_the_ring_plays_from_the_constructor_on_and_clears_what_it_has_played(on_chip):
    """The first buffer that becomes free is the first one played, four buffers earlier."""
    said, heard = on_chip(
        "i2s = asynchronous()\n"
        "chip.advance(1023)\n"
        "print(i2s.write(filled(1)))\n"
        "chip.advance(1)\n"
        "print(i2s.write(filled(1)), i2s.write(filled(2)))\n"
        "chip.advance(10 * 1024)"
    )
    assert said == ["0", "1024 0"]
    assert heard == [(n * 1024, 1 if n == 4 else 0, 1024) for n in range(11)]


def test_the_queue_of_free_buffers_drops_its_oldest(on_chip):
    """However long nothing was written: three of four are free, including the next one to play."""
    said, heard = on_chip(
        "i2s = asynchronous()\n"
        "chip.advance(9 * 1024)\n"
        "print([i2s.write(filled(n)) for n in range(1, 6)])\n"
        "chip.advance(5 * 1024)"
    )
    assert said == ["[1024, 1024, 1024, 0, 0]"]
    assert values(heard)[9:] == [0, 1, 2, 3, 0]


def test_half_a_buffer_stays_current(on_chip):
    """Later data go into its rest, which the ring has passed, and into the next free buffer: the
    two halves are played in the wrong order."""
    _, heard = on_chip(
        "i2s = asynchronous()\n"
        "chip.advance(1024)\n"
        "i2s.write(memoryview(filled(1))[:512])\n"
        "chip.advance(5 * 1024)\n"
        "i2s.write(filled(2))\n"
        "chip.advance(8 * 1024)"
    )
    assert [(n, value, count) for n, (_, value, count) in enumerate(heard) if count < 1024] == [
        (4, 1, 512),
        (7, 2, 512),
        (8, 0, 512),
    ]


def test_a_blocking_write_waits_for_room(on_chip):
    said, heard = on_chip(
        "i2s = I2S(0, **OK)\nprint(i2s.write(filled(1) + filled(2)), chip.now())\n"
        "chip.advance(5 * 1024)"
    )
    assert said == ["2048 2048"]
    assert values(heard) == [0, 0, 0, 0, 1, 2, 0]


def test_deinit_ends_it_at_once_and_a_new_one_begins_with_zeros(on_chip):
    _, heard = on_chip(
        "i2s = asynchronous()\n"
        "chip.advance(3 * 1024)\n"
        "i2s.write(filled(1))\n"
        "i2s.deinit()\n"
        "chip.advance(9000)\n"
        "asynchronous()\n"
        "chip.advance(5 * 1024)"
    )
    assert [t for t, _, _ in heard] == [0, 1024, 2048, *range(12072, 12072 + 5120, 1024)]
    assert set(values(heard)) == {0}


def test_the_scheduler_holds_eight(on_chip):
    """It runs nothing inside machine code or a collection, however long they take."""
    said, _ = on_chip(
        "calls = []\n"
        "timer = Timer(0, period=1, callback=lambda t: calls.append(chip.now()))\n"
        "chip.advance(500)\n"
        "@micropython.viper\n"
        "def kernel(advance):\n"
        "    i = 0\n"
        "    while i < 20:\n"
        "        advance(1000)\n"
        "        i += 1\n"
        "kernel(chip.advance)\n"
        "print(len(calls))\n"
        "settle()\n"
        "print(len(calls), calls[0])\n"
        "chip.collection(5000)\n"
        "calls.clear()\n"
        "gc.collect()\n"
        "print(len(calls), chip.now())\n"
        "settle()\n"
        "print(len(calls))\n"
    )
    assert said == ["0", "8 20500", "0 25500", "5"]


@pytest.mark.parametrize("pause", [0, 1, 7, 25])
def test_a_pause_loses_what_the_queue_cannot_hold(on_chip, pause):
    """A timer each millisecond, and a main loop that pauses between."""
    said, _ = on_chip(
        "calls = []\n"
        "timer = Timer(0, period=1, callback=calls.append)\n"
        f"chip.advance({pause} * 1000)\n"
        "settle()\n"
        "print(len(calls))"
    )
    assert said == [str(min(pause, 8))]


def test_a_timer_once_and_its_value(on_chip):
    said, _ = on_chip(
        "calls = []\n"
        "timer = Timer(1, mode=Timer.ONE_SHOT, period=5, callback=calls.append)\n"
        "chip.advance(3000)\n"
        "print(timer.value())\n"
        "chip.advance(9000)\n"
        "settle()\n"
        "print(len(calls), calls[0] is timer)"
    )
    assert said == ["3", "1 True"]


def test_a_pin_interrupts_on_its_edge(on_chip):
    said, _ = on_chip(
        "calls = []\n"
        "pin = Pin(4, Pin.IN, Pin.PULL_UP)\n"
        "pin.irq(lambda p: calls.append(p.value()), Pin.IRQ_FALLING)\n"
        "print(pin.value())\n"
        "chip.drive(4, 0)\n"
        "settle()\n"
        "chip.drive(4, 1)\n"
        "settle()\n"
        "print(calls)"
    )
    assert said == ["1", "[0]"]


def test_while_flash_is_written_the_ring_plays_its_old_content(on_chip):
    """80 ms: no interrupt comes, so nothing is cleared. Afterwards one comes for each source."""
    said, heard = on_chip(
        "i2s = asynchronous()\n"
        "chip.advance(3 * 1024)\n"
        "for n in (1, 2, 3):\n"
        "    i2s.write(filled(n))\n"
        "calls = []\n"
        "timer = Timer(0, period=1, callback=calls.append)\n"
        "pin = Pin(4, Pin.IN)\n"
        "pin.irq(calls.append, Pin.IRQ_RISING)\n"
        "chip.advance(500)\n"
        "chip.flash(80_000)\n"
        "chip.drive(4, 1)\n"
        "settle()\n"
        "print(len(calls))\n"
        "chip.advance(3000)\n"
    )
    assert said == ["2"]
    assert values(heard)[3:15] == [0, 1, 2, 3] * 3


def test_the_rate_of_the_repl_is_set_before_an_error(on_chip):
    """ESP-IDF's driver, which MicroPython asks next, is not there for that UART."""
    said, _ = on_chip(
        "from machine import UART\n"
        "print(error(UART, 0, 460800), error(UART, 0, 0))\n"
        "print(error(UART, 0, 6_000_000))"
    )
    assert said == ["('OSError', -259) ('OSError', -259)", "('OSError', 1)"]


def test_the_watchdog_ends_the_chip_unless_it_is_fed(on_chip):
    said, _ = on_chip(
        "from machine import WDT\n"
        "print(error(WDT, 1), error(WDT, 0, 0))\n"
        "dog = WDT(0, 1000)\n"
        "for _ in range(5):\n"
        "    chip.advance(900_000)\n"
        "    dog.feed()\n"
        "dog = WDT(0, 3000)\n"
        "chip.advance(2_900_000)\n"
        "print('alive')\n"
        "chip.advance(200_000)\n"
        "print('never')"
    )
    assert said == ["('ValueError',) ('ValueError', 'WDT timeout too short')", "alive"]


def test_a_disarmed_watchdog_waits_for_days(on_chip):
    """framestep's own: it cannot be stopped, but a timer feeds it once a day."""
    said, _ = on_chip(
        "from framestep.hal.esp32.watchdog import Watchdog\n"
        "dog = Watchdog()\n"
        "dog.disarm()\n"
        "dog.arm(8000)\n"
        "chip.advance(7_000_000)\n"
        "dog.disarm()\n"
        "for hour in range(20 * 24):\n"
        "    chip.advance(1_000_000_000)\n"
        "    chip.advance(1_000_000_000)\n"
        "    chip.advance(1_000_000_000)\n"
        "    chip.advance(600_000_000)\n"
        "    settle()\n"
        "print('alive', dog.caused_reset)"
    )
    assert said == ["alive False"]


def test_a_uart_and_its_arguments(on_chip):
    said, _ = on_chip(
        "from machine import UART\n"
        "print(error(UART, 3), error(UART, 1, bits=9, tx=Pin(4), rx=Pin(5)))\n"
        "print(error(UART, 1, tx=Pin(34), rx=Pin(5)))\n"
        "print(error(UART, 1, tx=Pin(4), rx=Pin(5), rxbuf=128))\n"
        "uart = UART(1, 250000, stop=2, tx=Pin(4), rx=Pin(5), txbuf=2048)\n"
        "print(uart.write(bytes(513)), uart.txdone(), chip.now())\n"
        "chip.advance(22500)\n"
        "print(uart.txdone())\n"
        "chip.advance(100)\n"
        "print(uart.txdone(), uart.any(), uart.read(4))"
    )
    assert said == [
        "('ValueError', 'UART(3) does not exist') ('ValueError', 'invalid data bits')",
        "('OSError', 1)",
        "('OSError', 1)",
        "513 False 0",
        "False",
        "True 0 None",
    ]
