"""The emulated Pico 2: its processor against QEMU, the image's chip, and twelve motors."""

import subprocess

import numpy as np
import pytest

from framestep_emulator import Emulator
from framestep_emulator.errors import EmulatorError
from framestep_emulator.node import Pool
from framestep_tools.building import images
from framestep_tools.payloads import MotorMove
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.end_to_end.session import Session

BLOCKS = 200  # for which test/pieces33.mjs has a record
STEPS_PER_S = 20_000
ACCELERATION = 100_000


def test_instructions_agree_with_qemu(paths):
    script = paths.root / "tools/framestep_emulator/board/test/qemu.mjs"
    result = subprocess.run(["node", script, "m33"], capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    assert result.stdout == "4950 cases of 77 groups, 0 differ\n"


def test_functions_of_code_agree_with_its_steps(paths):
    """Registers, flags, memory, cycles, cache and edges; for random code with a record as well."""
    script = paths.root / "tools/framestep_emulator/board/test/pieces33.mjs"
    command = ["node", script, str(BLOCKS), images.frozen("pico2")]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    assert result.stdout.startswith("random blocks: ")


@pytest.mark.parametrize(
    ("board", "chip", "said"),
    [
        ("pico", "RP2350", "the image is for an RP2040, and the emulated chip is an RP2350"),
        ("pico2", "B2", "the image is for an RP2350, and the emulated chip is an RP2040"),
        ("pico2", "B3", "--chip B3: expected RP2350 or, of the RP2040, B0, B1, B2"),
    ],
)
def test_an_image_of_the_other_chip_is_refused(board, chip, said, capfd):
    with pytest.raises(EmulatorError, match="did not start"):
        Emulator(firmware=images.frozen(board), args=["--chip", chip]).start()
    assert said in capfd.readouterr().err


PYTHON = """
import math, time, machine
@micropython.viper
def total(n: int) -> int:
    found = 0
    while n:
        found += n
        n -= 1
    return found
print(total(1000), 7 ** 40 % 1000007, math.sin(0.5), 1 / 3, machine.freq())
begun = time.ticks_us()
time.sleep_ms(20)
print(time.ticks_diff(time.ticks_us(), begun) // 1000)
"""


def test_python(emulator):
    board = emulator(firmware=images.frozen("pico2"))
    first, second = board.repl().exec(PYTHON).split("\n")[:2]
    whole, power, sine, third, clock = first.split()
    assert (int(whole), int(power), int(clock)) == (500_500, 7**40 % 1_000_007, 150_000_000)
    assert float(sine) == pytest.approx(np.sin(0.5), rel=1e-6)
    assert float(third) == pytest.approx(1 / 3, rel=1e-6)
    assert int(second) in (19, 20, 21)


PARTS = """
import machine, rp2
from machine import Pin, mem32
spi = machine.SPI(0, 1_000_000, sck=Pin(18), mosi=Pin(19), miso=Pin(16))
received = bytearray(b"x" * 40)
spi.write_readinto(bytes(range(40)), received)
print(received == bytes(40))
print(machine.I2C(0, sda=Pin(4), scl=Pin(5)).scan())
"""


def test_spi_and_i2c_end_their_transfers_with_nothing_connected(emulator):
    board = emulator(firmware=images.frozen("pico2"))
    assert board.repl().exec(PARTS).split() == ["True", "[]"]


REGISTERS = """
import rp2
from machine import mem32
@rp2.asm_pio()
def idle():
    nop()
PIO = 0x50300000  # a block that framestep's motors leave free in this rig
machine = rp2.StateMachine(7, idle, freq=1_000_000)
SM, ENTRIES = PIO + 0xc8 + 3 * 0x18, PIO + 0x128 + 3 * 16
def run(word):
    mem32[SM + 0x10] = word
mem32[SM + 8] = 0x8000  # FJOIN_RX_PUT
machine.exec("set(y, 2)")
machine.exec("set(x, 21)")
machine.exec("mov(isr, x)")
run(0x8010)  # mov rxfifo[y], isr
run(0x8019)  # mov rxfifo[1], isr
print([mem32[ENTRIES + 4 * i] for i in range(4)])
mem32[SM + 8] = 0x4000  # FJOIN_RX_GET
mem32[ENTRIES + 12] = 77
run(0x809b)  # mov osr, rxfifo[3]
machine.exec("mov(y, osr)")
mem32[SM + 8] = 0xc0000
machine.exec("mov(isr, y)")
machine.exec("push()")
print(machine.get())
"""


def test_a_machines_fifo_as_registers(emulator):
    board = emulator(firmware=images.frozen("pico2"))
    assert board.repl().exec(REGISTERS).splitlines() == ["[0, 21, 21, 0]", "77"]


SLICES = """
import machine, time
from machine import Pin, PWM, mem32
PWM_BASE = 0x400a8000
pin = PWM(Pin(2), freq=1000, duty_u16=32768)
TENTH = PWM_BASE + 10 * 0x14
mem32[TENTH + 4] = 150 << 4  # a million counts a second
mem32[TENTH + 16] = 9_999
mem32[PWM_BASE + 0xf0] |= 1 << 10
time.sleep_ms(25)
print(mem32[PWM_BASE + 0xf4] & 1 << 10 != 0, pin.freq())
mem32[PWM_BASE + 0xf4] = 1 << 10
print(mem32[PWM_BASE + 0xf4] & 1 << 10, mem32[PWM_BASE + 0xf0] >> 8 & 15)
"""


def test_slices_without_pins_count_and_wrap(emulator):
    board = emulator(firmware=images.frozen("pico2"))
    assert board.repl().exec(SLICES).splitlines() == ["True 1000", "0 4"]


LIMITED = """
import micropython
@micropython.asm_thumb
def limit_the_stack(r0):
    data(2, 0xf380, 0x880a)  # msr msplim, r0
limit_the_stack(0x20081000)
def deeper(n):
    return n and deeper(n - 1)
deeper(100)
"""


def test_a_stack_that_grows_past_its_limit_is_told(emulator):
    board = emulator(firmware=images.frozen("pico2"))
    with pytest.raises(EmulatorError):
        board.repl().exec(LIMITED)
    assert "the stack pointer is below its limit 20081000" in board.halted


def test_files_outlive_a_reset(emulator):
    board = emulator(firmware=images.frozen("pico2"), files={"/kept.txt": "once"})
    assert board.repl().exec("print(open('/kept.txt').read())").strip() == "once"
    board.repl().exec("with open('/kept.txt', 'w') as file: file.write('twice')")
    board.reset()
    board.wait_usb()
    assert board.repl().exec("print(open('/kept.txt').read())").strip() == "twice"


@pytest.fixture
def pool(monkeypatch):
    found = Pool()
    monkeypatch.setattr(Emulator, "pool", found)
    yield found
    found.close()


def test_code_that_an_earlier_board_has_run_changes_nothing(pool):
    """Its next board goes on with it: state and time are those of a board of its own."""
    Emulator.pool = None
    with EmulatedBoard({"motor_count": 3}, board="pico2") as alone:
        expected = alone.emulator.cmd("digest")
    Emulator.pool = pool
    with EmulatedBoard({"motor_count": 2}, board="pico2") as other:
        other.run_until(other.now_ns + 100_000_000)
    with EmulatedBoard({"motor_count": 3}, board="pico2") as board:
        assert board.emulator.cmd("digest") == expected
    assert len(pool.idle) == 1


def test_code_of_another_image_is_not_that_of_the_board_before(pool, tmp_path):
    """This one stops where it is reset."""
    image = images.frozen("pico2")
    content = bytearray(image.read_bytes())
    begins = int.from_bytes(content[4:8], "little") - 0x1000_0000 & ~1
    content[begins : begins + 2] = b"\x00\xde"  # udf
    changed = tmp_path / "changed.bin"
    changed.write_bytes(content)
    with Emulator(image, boot=False) as first:
        first.advance(20)
        assert not first.halted
    with Emulator(changed, boot=False) as second:
        second.advance(20)
        assert second.halted
    with Emulator(image, boot=False) as third:
        third.advance(20)
        assert not third.halted
    assert len(pool.idle) == 1


def test_twelve_motors_keep_their_rate():
    """While all move, the intervals of each motor's steps are even to half a microsecond."""
    with EmulatedBoard(board="pico2") as board:
        session = Session(board, motors=12)
        for motor in range(1, 13):
            session.speed(motor, STEPS_PER_S, ACCELERATION)
        session.forget().accept(*(MotorMove(motor, 6_000) for motor in range(1, 13))).wait_idle()
        positions = session.ask_positions().steps
        assert positions == (6_000,) * 12
        for motor in range(1, 13):
            times, signs = session.steps(motor)
            assert int(signs.sum()) == 6_000
            middle = np.diff(times[2_500:3_500])
            assert np.abs(middle - 1 / STEPS_PER_S).max() < 0.5e-6
