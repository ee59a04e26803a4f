"""What framestep asks of a chip: the classes that a HAL is made of. docs/new-chip.md says how to write one.

This module is not put on a board, so a HAL does not inherit from it. host_tests/hal/test_contract.py holds every HAL to
these names and parameters, and what is above the HAL to using nothing else. A method that need not do anything says
what it returns then. After Hal.start() nothing allocates.

What the tick has to know of the chip's pulse engine is in engine.py.
"""


class Hal:
    """A board. Made once, by boot, from the board's data and a rig file (framestep.rig.Rig); keeps the drivers off.

    motors          how many there are
    board           the board's data: boards/<board>/board.json as a dictionary, with what this rig
                    file changes in it
    kernel          motion.kernel.StepKernel; it ticks after start()
    engine          a PulseEngine
    port            the Port of the protocol
    dmx             a Dmx
    watchdog        a Watchdog
    driver_wire     the DriverWire, where Rig.drivers is not None
    upload_bytes    bytes that the uploaded move may take, in one piece
    inside          array of words; [PASS] is 1 while the main loop is in a pass
    passes          machine.Timer, not started, whose callbacks come from MicroPython's scheduler,
                    for runner.py
    report_driver   report_driver(motor, text) prints on the REPL what the driver of a motor (from 1)
                    does; set by the runner
    """

    def start(self):
        """Begin to tick, and claim the protocol's port. Called once."""
        raise NotImplementedError

    def irq_off(self):
        """Keep the tick away for some microseconds; what irq_on() wants."""
        raise NotImplementedError

    def irq_on(self, state):
        """Let the tick come again."""
        raise NotImplementedError

    def idle(self):
        """Nothing to do: wait for the next interrupt."""
        raise NotImplementedError

    def enable(self, motor, on):
        """Switch a motor's driver on or off; drivers that share a pin are on while one of them is."""
        raise NotImplementedError

    def led(self, colour):
        """Light the board's LED in a colour 0xRRGGBB, as far as there is one and it has colours; 0: off."""
        raise NotImplementedError

    def output(self, pin, level):
        """Make a pin an output, at boot; the bit that stands for it in drive(), below 2^30."""
        raise NotImplementedError

    def input(self, pin, pull):
        """Make a pin an input with pull "up", "down" or "none", at boot; its bit in levels(), below 2^30."""
        raise NotImplementedError

    def drive(self, high, low):
        """Drive the pins of these bits high and low, all at once; from interrupt handlers too."""
        raise NotImplementedError

    def levels(self):
        """Bits of the pins that are high, outputs as well."""
        raise NotImplementedError

    def whole_stack(self, work):
        """A function of one argument that calls work with all of the stack, whatever a program on the
        REPL has taken of it. For callbacks; allocates."""
        return work

    def watch(self, bits, handler):
        """Call handler(x) from a hard interrupt when one of these inputs changes. Once, at boot."""
        raise NotImplementedError

    def take_lost_commands(self):
        """Motors of which a pulse command was lost since the last call, so steps are missing: a bit each."""
        raise NotImplementedError

    def reclaim(self):
        """Give pins that something else has taken their function again.

        -1 where none was taken, else the motors that may have missed pulses by it: a bit each.
        """
        raise NotImplementedError

    def ready(self):
        """False while the chip may let go of a pin, as the RP2040 B1 does after a reset of the USB bus.

        Nothing is to be started then.
        """
        raise NotImplementedError

    def flash(self):
        """A Flash, at boot; OSError where there is none."""
        raise NotImplementedError


class PulseEngine:
    """Makes edges of the commands of the tick; engine.py says what they are and how long they take.

    What it cannot do in time it tells by Hal.take_lost_commands(), and it never makes up for it by a burst.
    """

    def fifo(self, motor):
        """Address that takes a motor's commands, or of its ring: see engine.RING."""
        raise NotImplementedError


class Port:
    """The protocol's port.

    open        whether the host has it open (DTR); True where that cannot be seen
    openings    how often it has been opened; a change means a new host
    """

    def start(self):
        """Claim the port."""
        raise NotImplementedError

    def stop(self):
        """Give it back to the REPL; only of a port that is the REPL's."""
        raise NotImplementedError

    def poll(self, reader):
        """Move received bytes into reader.feed(buffer, start, count); how many were moved."""
        raise NotImplementedError

    def send(self, writer):
        """Begin to send what writer.take(buffer, limit) hands out; never waits.

        Something true where something else is still under way: ask again in the next pass.
        """
        raise NotImplementedError


class Dmx:
    """Puts light levels on a wire.

    channels    how many, 512, or 0 where there is no DMX
    """

    def show(self, lights):
        """Send the levels of an io.lights.Lights on if any has changed. Once a pass at most."""
        raise NotImplementedError


class Watchdog:
    """Starts the board again when it is not fed.

    caused_reset      whether it has started the board this time
    """

    def arm(self, ms):
        """From now on it is to be fed within so many milliseconds.

        While something else than a pass holds up the main loop, and the tick has brought all motors to rest, it feeds
        itself.
        """
        raise NotImplementedError

    def feed(self):
        """Keep it quiet; only while it is armed."""
        raise NotImplementedError

    def disarm(self):
        """It need not be fed any more."""
        raise NotImplementedError


class DriverWire:
    """The UART of the motors' drivers."""

    def select(self, motor):
        """The driver of this motor (from 0) is to be talked to; where each has a line of its own."""
        raise NotImplementedError

    def send(self, buffer, count):
        """Put up to 8 bytes on the line; never waits."""
        raise NotImplementedError

    def receive(self, buffer, at, limit):
        """Bytes that have come since, at most `limit`, into buffer[at:]; how many. What was sent comes back as well."""
        raise NotImplementedError


class Flash:
    """Storage that outlives a power cut, for io/position_journal.py.

    blocks      how many, at least 2
    bytes       of a block
    """

    def read(self, block, at, buffer):
        """Fill the buffer from a place in a block."""
        raise NotImplementedError

    def program(self, block, at, page):
        """Clear the bits that are 0 in these 256 bytes, `at` being a multiple; False where that is not possible."""
        raise NotImplementedError

    def erase(self, block, page):
        """Set all bits of a block, with 256 bytes to work with; False where that is not possible."""
        raise NotImplementedError
