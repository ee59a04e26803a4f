"""Parts of the HAL that board and rig choose; unloaded once the board is up."""

import machine
from machine import Pin

from framestep.hal.rp2.pin_guard import Claim
from framestep.pulse.engine import FASTEST_HZ, RING


def engine(board, rig):
    """Return the PulseEngine and the StepKernel of a rig's motors."""
    if RING:
        from framestep.hal.rp2.pulses import made  # type: ignore[attr-defined]  # of registers.py

        return made(board, rig)
    from framestep.hal.rp2 import chip
    from framestep.hal.rp2.pulses import PulseEngine
    from framestep.pulse.kernel import StepKernel
    from framestep.pulse.shape import pulse_shape

    hz = machine.freq()
    while hz > FASTEST_HZ:
        hz //= 2
    cycles_per_us = hz // 1000000
    shapes = [pulse_shape(rig.motor(i), cycles_per_us) for i in range(len(board["step"]))]
    found = PulseEngine(board["step"], board["dir"], hz, shapes)
    kernel = StepKernel(len(shapes), cycles_per_us * 1000, chip.MICROSECONDS)
    kernel.outputs(chip.OUT_SET, chip.OUT_CLEAR)
    for i, shape in enumerate(shapes):
        kernel.configure(i, found.fifo(i), *shape)
    return found, kernel


def servos(hal, rig):
    """Return the Servos of a rig that has some."""
    from framestep.hal.servos import make_servos
    from framestep.pulse.stepper import CYCLES_PER_US

    motors = range(hal.motors)
    return make_servos(
        hal.kernel,
        [rig.motor(i) for i in motors],
        [hal.engine.fifo(i) for i in motors],
        hal.kernel.state[CYCLES_PER_US],
    )


def dmx(wiring, rig):
    """Return what sends DMX, or does nothing. wiring: from board.json, or None."""
    if wiring is None or not rig.dmx:
        from framestep.hal.absent import NoDmx

        return NoDmx()
    from framestep.hal.rp2.dmx import Dmx

    with Claim(wiring["tx"], wiring["rx"]):
        sender = Dmx(wiring, machine.freq(), rig.dmx_break_us, rig.dmx_mark_us)
    sender.start()
    return sender


def watchdog(rig):
    """Return the Watchdog, or one that does nothing."""
    if rig.watchdog:
        from framestep.hal.rp2.watchdog import Watchdog

        return Watchdog()
    from framestep.hal.absent import NoWatchdog

    return NoWatchdog()


def wire(wiring, motors):
    """Return the wire to the drivers of a number of motors. wiring: from board.json."""
    if "pins" in wiring:
        from framestep.hal.rp2.one_wire import OneWire

        pins = wiring["pins"][:motors]
        with Claim(*pins):
            return OneWire(pins, motors)
    from framestep.hal.rp2.wire import Wire

    with Claim(wiring["tx"], wiring["rx"]):
        return Wire(wiring)


def port(ports):
    """Return the protocol's port on a board with one port or two."""
    if ports == 2:
        from framestep.hal.ports.usb_port import UsbPort

        return UsbPort()
    from framestep.hal.ports.stdin_port import StdinPort

    return StdinPort()


def led(board, motors):
    """Return a function that shows a colour, 0xRRGGBB, on the board's LED, if it has one."""
    if "led" in board:
        with Claim(board["led"]):
            return Pin(board["led"], Pin.OUT, value=0).value
    if "rgb" not in board:
        return lambda _colour: None
    from framestep.hal.rp2.rgb import RgbLed

    # The first state machine that neither motors nor the drivers' lines (one_wire.py) use.
    machine = motors
    if machine % 4 == 0:
        machine += 2 * len(board.get("drivers", {}).get("pins", ()))
    with Claim(board["rgb"]):
        try:
            return RgbLed(board["rgb"], machine).show
        except OSError:  # the PIO block has no room: its motors have two programs (edges.py)
            return lambda _colour: None
