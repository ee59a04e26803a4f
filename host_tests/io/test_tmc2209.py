"""TMC2209 drivers on a simulated wire: registers, their confirmation, lost and damaged telegrams,
texts of faults."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from framestep.hal.host import BOARD
from framestep.io import tmc2209
from framestep.io.tmc2209_setup import least_ma, most_ma, registers, scale
from framestep.rig import Rig, RigError
from framestep_tools.building.board_files import board_data
from framestep_tools.simulator import driver_chips as chip
from framestep_tools.simulator.driver_chips import Chip, Chips, crc8

SKR_PICO = board_data("skr_pico")
RIG = {"motors": [{"driver": {"run_ma": 800}}, {"driver": {"run_ma": 400, "mode": "spread"}}]}
RESET_S = 0.2  # for two drivers to be set up


class Wired:
    """Drivers, chips and time; a pass every millisecond, or as `passes` says (microseconds)."""

    def __init__(self, rig=None, board=SKR_PICO, passes=1000):
        self.rig = Rig(RIG if rig is None else rig, board)
        self.board = self.rig.board
        self.motors = self.board["motors"]
        self.now_us = 0
        self.passes = itertools.repeat(passes) if isinstance(passes, int) else passes
        addresses = [
            a
            for a, table in zip(self.board["drivers"]["address"], self.rig.drivers, strict=False)
            if table
        ]
        self.chips = [Chip(address) for address in addresses]
        self.driver_wire = Chips(self.chips, lambda: self.now_us * 1000)
        self.said = []
        self.drivers = tmc2209.Drivers(self, self.rig)
        self.failed = 0

    def report_driver(self, motor, text):
        self.said.append(f"{motor} {text}")

    def run(self, seconds):
        end = self.now_us + seconds * 1e6
        while self.now_us < end:
            self.failed |= self.drivers.poll(self.now_us // 1000 & 0x3FFFFFFF)
            self.now_us += next(self.passes)
        return self


def test_crc():
    """The maker's telegram for IOIN of driver 0, and any other: the maker's algorithm bit by bit,
    ours as on the board."""
    assert crc8(b"\x05\x00\x06") == tmc2209.crc(b"\x05\x00\x06", 0, 3) == 0x6F


@given(st.binary(max_size=8))
def test_crc_of_anything(data):
    assert tmc2209.crc(data, 0, len(data)) == crc8(data)


def one(**driver):
    """Return the chip after its set-up, with the default settings except for these."""
    wired = Wired({"motors": [{"driver": {"run_ma": 500} | driver}]}).run(RESET_S)
    assert wired.drivers.ready == 0b1111
    assert not wired.said
    return wired.chips[0]


def test_steps_on_both_edges():
    """The chip gets the setting with its bridges off, and without the filter, which does not work
    with it (TMC2209 datasheet, CHOPCONF)."""
    driver = one(both_edges=True)
    chopper = [value for register, value in driver.writes if register == chip.CHOPCONF]
    assert [value >> 29 & 1 for value in chopper] == [1, 1]
    assert driver.registers[chip.GCONF] == 0b1100_0000
    assert driver.microsteps == 16


def test_registers():
    driver = one()
    assert driver.writes[0] == (chip.NODECONF, 0x200)
    registers = driver.registers
    # UART rules, internal current reference, StealthChop
    assert registers[chip.GCONF] == 0b1_1100_0000
    assert (
        registers[chip.VACTUAL]
        == registers[chip.TPWMTHRS]
        == registers[chip.TCOOLTHRS]
        == registers[chip.COOLCONF]
        == 0
    )
    assert registers[chip.PWMCONF] == 0xC10D0024
    assert driver.gstat == 0
    assert driver.microsteps == 16
    assert registers[chip.CHOPCONF] >> 28 == 1
    assert 480 < driver.run_ma() <= 500
    assert registers[chip.TPOWERDOWN] == pytest.approx(500 / (2**18 / 12e6 * 1000), abs=0.5)
    chopper = [value for register, value in driver.writes if register == chip.CHOPCONF]
    assert chopper[0] & 0xF == 0
    assert chopper[-1] & 0xF == 3
    assert driver.writes[-1][0] == chip.CHOPCONF


@pytest.mark.parametrize(
    ("driver", "register", "bits", "value"),
    [
        ({"mode": "spread"}, chip.GCONF, 4, 4),
        ({"interpolate": False}, chip.CHOPCONF, 1 << 28, 0),
        ({"microsteps": 1}, chip.CHOPCONF, 0xF << 24, 8 << 24),
        ({"microsteps": 256}, chip.CHOPCONF, 0xF << 24, 0),
        ({"hold_percent": 0}, chip.PWMCONF, 3 << 20, 1 << 20),
        ({"hold_percent": 0}, chip.IHOLD_IRUN, 0x1F, 0),
        ({"hold_delay_ms": 50}, chip.TPOWERDOWN, 0xFF, 2),
        ({"hold_delay_ms": 5500}, chip.TPOWERDOWN, 0xFF, 252),
    ],
)
def test_settings(driver, register, bits, value):
    assert one(**driver).registers[register] & bits == value


@pytest.mark.parametrize("percent", [50, 99, 100])
def test_hold_current(percent):
    """Never above its share of the running current."""
    driver = one(run_ma=900, hold_percent=percent)
    irun, ihold = (driver.registers[chip.IHOLD_IRUN] >> shift & 0x1F for shift in (8, 0))
    assert percent / 100 - 1 / (irun + 1) < (ihold + 1) / (irun + 1) <= percent / 100


@given(st.integers(10, 2000), st.integers(50, 1000))
def test_current(run_ma, sense_mohm):
    """Never above the requested current, and at most one of 32 steps below it; out of range exactly
    below least_ma and above most_ma."""
    found = scale(run_ma, sense_mohm)
    assert (found is not None) == (least_ma(sense_mohm) <= run_ma <= most_ma(sense_mohm))
    if found:
        irun, vsense = found
        step = (0.18 if vsense else 0.32) / (sense_mohm + 20) / 2**0.5 * 1e6 / 32
        current = (irun + 1) * step
        assert current <= run_ma + 1e-6
        assert current > run_ma - step - 1e-3
        assert vsense or run_ma > 0.18 / (sense_mohm + 20) / 2**0.5 * 1e6 - 1


def test_every_motor_has_its_own():
    wired = Wired().run(RESET_S)
    assert [c.address for c in wired.chips] == [0, 2]
    assert 380 < wired.chips[1].run_ma() <= 400 < 760 < wired.chips[0].run_ma() <= 800
    assert wired.chips[0].registers[chip.GCONF] & 4 == 0
    assert wired.chips[1].registers[chip.GCONF] & 4
    assert wired.drivers.writes == sum(len(c.writes) for c in wired.chips) == 24


def test_ready_only_when_all_have_been_tried():
    wired = Wired()
    while not wired.drivers.ready:
        assert wired.now_us < RESET_S * 1e6
        assert (
            not all(c.bridges_on and c.gstat == 0 and len(c.writes) == 12 for c in wired.chips)
            or wired.now_us
        )
        wired.run(0.001)
    assert all(len(c.writes) == 12 and c.bridges_on for c in wired.chips)


@settings(max_examples=25)
@given(st.lists(st.integers(50, 12_000), min_size=20, max_size=60))
def test_a_main_loop_of_any_pace(passes):
    """Passes far apart and close together: nothing is sent during an answer, every write is
    confirmed at once."""
    wired = Wired(passes=itertools.cycle(passes)).run(6)
    assert wired.drivers.ready == 0b1111
    assert not wired.said
    assert [len(c.writes) for c in wired.chips] == [12, 12]


def test_without_echo():
    wired = Wired()
    wired.driver_wire.echo = False
    assert wired.run(RESET_S).drivers.ready == 0b1111


def spoil(wired, direction, which, how):
    """Apply `how` to the telegrams of this direction whose numbers are in `which`."""
    numbers = itertools.count()

    def change(way, data):
        return how(data) if way == direction and next(numbers) in which else data

    wired.driver_wire.spoil = change


def flipped(data):
    return data[:3] + bytes([data[3] ^ 0x10]) + data[4:]


@pytest.mark.parametrize("how", [flipped, lambda data: b""])
@pytest.mark.parametrize("direction", ["to", "from"])
@pytest.mark.parametrize("first", [0, 1, 2, 7])
def test_noise_and_losses(direction, first, how):
    """Single telegrams damaged or lost: they are repeated, and in the end every register is set."""
    wired = Wired()
    spoil(wired, direction, range(first, 60, 5), how)
    wired.run(1)
    assert wired.drivers.ready == 0b1111
    assert not wired.said
    assert not wired.failed
    for driver in wired.chips:
        wanted = [value for register, value in driver.writes if register == chip.CHOPCONF]
        assert driver.registers[chip.IHOLD_IRUN] != 0x11F00
        assert wanted[-1] & 0xF == 3
        assert driver.gstat == 0


def test_a_reset_in_the_middle_of_the_set_up():
    wired = Wired().run(0.05)
    assert 0 < len(wired.chips[0].writes) < 12
    wired.chips[0].reset()
    wired.run(RESET_S)
    assert wired.drivers.ready == 0b1111
    assert wired.chips[0].registers[chip.NODECONF] == 0x200
    assert wired.chips[0].registers[chip.GCONF] == 0x1C0


def test_nothing_on_the_wire():
    wired = Wired()
    wired.driver_wire.receive = lambda buffer, at, limit: 0
    wired.run(1)
    assert wired.drivers.ready == 0b1100
    assert [text for text in wired.said if "gets no echo on the wire" in text] == wired.said
    assert len(wired.said) == 2


def test_a_deaf_driver():
    wired = Wired()
    spoil(wired, "to", range(10_000), lambda data: flipped(data) if len(data) == 8 else data)
    wired.run(0.5)
    assert wired.drivers.ready == 0b1100
    assert "1 answers, but does not take its settings" in wired.said


def test_confirmation_is_by_the_counter():
    """A driver whose counter does not change is not trusted."""
    wired = Wired()
    take = wired.chips[0].take
    wired.chips[0].take = lambda telegram: (take(telegram), setattr(wired.chips[0], "count", 7))[0]
    wired.run(1)
    assert wired.drivers.ready == 0b1110
    assert wired.said == ["1 answers, but does not take its settings"]


FAULTS = [
    (0x02, 2, "has switched off, too hot"),
    (0x04, 2, "has switched off: a short in the motor or its cable"),
    (0x20, 2, "has switched off: a short in the motor or its cable"),
    (0, 4, "has too little supply voltage"),
    (0, 2, "has switched off"),
]


@pytest.mark.parametrize(("status", "gstat", "words"), FAULTS)
def test_faults(status, gstat, words):
    wired = Wired().run(RESET_S)
    driver = wired.chips[0]
    driver.status |= status
    driver.gstat |= gstat
    wired.run(0.3)
    assert wired.failed == 0b0001
    assert wired.drivers.ready == 0b1110
    assert wired.said == [f"1 {words}"]
    # While it lasts the driver stays off and nothing more is reported; then it is set up again.
    if status:
        wired.run(2.5)
        assert wired.said == [f"1 {words}"]
        assert wired.drivers.ready == 0b1110
    before = len(driver.writes)
    driver.status = chip.STANDSTILL
    wired.run(1.5)
    assert wired.drivers.ready == 0b1111
    assert wired.said == [f"1 {words}", "1 works again"]
    assert len(driver.writes) - before == 12
    assert driver.gstat == 0


def test_states_in_words():
    wired = Wired()
    assert wired.drivers.states_in_words()[0] == "driver of motor 1 is being set up"
    wired.chips[1].powered = False
    wired.run(0.5)
    assert wired.drivers.states_in_words() == [
        "driver of motor 1 works",
        "driver of motor 2 does not answer (check its power and its address)",
    ]


@pytest.mark.parametrize(
    ("board", "rig", "text"),
    [
        (SKR_PICO, {"motors": [{"driver": {}}]},
         "motors[1].driver.run_ma: is missing, expected is a whole number from 10"),
        (SKR_PICO, {"motors": [{"driver": 3}]},
         "motors[1].driver: found 3, allowed is an object {…}"),
        (SKR_PICO, {"motors": [{}, {"driver": {"run_ma": 1900}}]},
         "motors[2].driver.run_ma: found 1900, allowed is 31 to 1740 mA with 110 mΩ"),
        (SKR_PICO, {"motors": [{"driver": {"run_ma": 30}}]},
         "motors[1].driver.run_ma: found 30, allowed is 31 to 1740 mA with 110 mΩ"),
        (SKR_PICO, {"motors": [{"driver": {"run_ma": 500, "mode": "spread", "hold_percent": 0}}]},
         'motors[1].driver.hold_percent: found 0, allowed is 1 to 100 in mode "spread"'),
        (SKR_PICO, {"motors": [{"driver": {"run_ma": 500, "microsteps": 10}}]},
         "microsteps: found 10, allowed is one of 1, 2, 4, 8, 16, 32, 64, 128, 256"),
        (SKR_PICO, {"motors": [{"driver": {"run_ma": 500, "microsteps": True}}]},
         "microsteps: found True"),
        (SKR_PICO, {"motors": [{"driver": {"run_ma": 500, "mode": "loud"}}]},
         'allowed is one of "stealth", "spread"'),
        (SKR_PICO, {"motors": [{"driver": {"run_ma": 500, "amps": 1}}]},
         "motors[1].driver.amps: no such setting"),
        (SKR_PICO, {"inputs": [{"pin": 8}]}, "which is the board's driver UART's tx already"),
        (BOARD, {"motors": [{}] * 4 + [{"driver": {"run_ma": 500}}]}, "that of motors 1 to 4"),
        (
            board_data("fysetc_erb"),
            {"motors": [{"driver": {"run_ma": 500, "pin": 16}}]},
            "motors[1].driver.pin: found 16, which is the board's step 2 already; "
            "allowed is a free pin",
        ),
        (board_data("fysetc_erb"), {"motors": [{"driver": {"run_ma": 500, "pin": 24}}]},
         "motors[1].driver.pin: found 24, which is wired as an input on this board"),
        (SKR_PICO, {"motors": [{"driver": {"run_ma": 500, "pin": 24}}]},
         "the drivers share a UART here"),
        (board_data("pico2"), {"motors": [{"driver": {"run_ma": 500}}]}, "that of no motor"),
    ],
)  # fmt: skip
def test_mistakes(board, rig, text):
    with pytest.raises(RigError) as error:
        Rig(rig, board)
    assert text in str(error.value)


def test_drivers_with_a_wire_each():
    """The FYSETC ERB: the same address on two wires; v1 has another pin than v2."""
    settings = {
        "motors": [{"driver": {"run_ma": 800, "pin": 20}}, {"driver": {"run_ma": 300}}],
        "inputs": [{"pin": 11}],
    }
    wired = Wired(settings, board_data("fysetc_erb"))
    assert wired.board["drivers"]["pins"] == [20, 17]
    wired.driver_wire.apart = True
    wired.run(RESET_S)
    assert wired.drivers.ready == 0b11
    assert wired.chips[1].run_ma() <= 300 < 700 < wired.chips[0].run_ma()
    assert [len(c.writes) for c in wired.chips] == [12, 12]


def test_a_rig_without_driver_settings_has_no_drivers():
    assert Rig({"motors": [{}]}, SKR_PICO).drivers is None


def test_drivers_move_the_camera_outputs_of_a_pico():
    rig = Rig({"motors": [{"driver": {"run_ma": 500}}]}, board_data("pico"))
    assert (rig.board["shutter"], rig.board["meter"], rig.board["drivers"]["tx"]) == (26, 27, 20)
    assert registers(rig.motors[0]["driver"]) == rig.drivers[0]
