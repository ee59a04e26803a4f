"""Classes that a HAL has to provide. docs/internals/new-chip.md says how to write one.

This module is not put on a board, so a HAL does not inherit from it.
host_tests/hal/test_contract.py checks that every HAL has these names and parameters, and that
nothing above the HAL uses others. After Hal.start() nothing allocates.

What the tick has to know of the chip's pulse engine is in engine.py.
"""


class Hal:
    """A board, made once, by boot, from its data and a framestep.rig.Rig. The drivers are off at
    first.

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
    report_driver   report_driver(motor, text) prints on the REPL what the driver of a motor (from
                    1) does; set by the runner
    """

    def start(self):
        """Start the tick, and claim the protocol's port. Called once."""
        raise NotImplementedError

    def irq_off(self):
        """Hold the tick off for some microseconds. Returns what irq_on() needs."""
        raise NotImplementedError

    def irq_on(self, state):
        """Let the tick come again. state: what irq_off() has returned."""
        raise NotImplementedError

    def idle(self):
        """Wait for the next interrupt: there is nothing to do."""
        raise NotImplementedError

    def enable(self, motor, on):
        """Switch a motor's driver on or off; of a servo, its pulses. Drivers that share a pin are
        on while any of them is."""
        raise NotImplementedError

    def led(self, colour):
        """Light the board's LED, if it has one, in a colour 0xRRGGBB, if it has colours; 0: off."""
        raise NotImplementedError

    def output(self, pin, level):
        """Make a pin an output, at boot. Returns its bit for drive(), below 2^30."""
        raise NotImplementedError

    def input(self, pin, pull):
        """Make a pin an input, at boot. Returns its bit in levels(), below 2^30.

        pull: "up", "down" or "none".
        """
        raise NotImplementedError

    def drive(self, high, low):
        """Drive the pins of these bits high and low, all at once. Interrupt handlers may call
        it."""
        raise NotImplementedError

    def levels(self):
        """The inputs that are high, one bit each; where all pins are alike, outputs too."""
        raise NotImplementedError

    def pass_callback(self, work):
        """A function of one argument that calls work, which is a pass, from MicroPython's
        scheduler: with all of the stack, whatever a program on the REPL has taken of it, and with
        inside[PASS] at 1. Allocates."""
        raise NotImplementedError

    def watch(self, bits, handler):
        """Call handler(x) from a hard interrupt when one of these inputs changes. Once, at boot."""
        raise NotImplementedError

    def take_lost_commands(self):
        """The motors of which commands were lost since the last call, so that steps are missing.

        One bit each.
        """
        raise NotImplementedError

    def reclaim(self):
        """Take back pins that something else, such as a program on the REPL, has set up anew.

        Returns -1 if there were none, else the motors that may have missed pulses, one bit each.
        """
        raise NotImplementedError

    def ready(self):
        """False while the chip may let go of a pin, as the RP2040 B1 does after a reset of the USB
        bus.

        Nothing is to be started then.
        """
        raise NotImplementedError

    def flash(self):
        """A Flash, at boot. OSError if there is none."""
        raise NotImplementedError


class PulseEngine:
    """Turns the tick's commands into edges; engine.py says what they are and how long they take.

    What it cannot do in time it reports by Hal.take_lost_commands(). It never makes up for it by a
    burst of pulses.
    """

    def fifo(self, motor):
        """The address to which a motor's commands are written, or of its ring: see engine.RING."""
        raise NotImplementedError


class Port:
    """The protocol's port.

    open        whether the host has it open (DTR); True if that cannot be seen
    openings    how often it has been opened: a change means a new host
    """

    def start(self):
        """Claim the port."""
        raise NotImplementedError

    def stop(self):
        """Give the port back to the REPL, if it is the REPL's."""
        raise NotImplementedError

    def poll(self, reader):
        """Move received bytes into reader.feed(buffer, start, count). Returns how many."""
        raise NotImplementedError

    def send(self, writer):
        """Begin to send what writer.take(buffer, limit) hands out. Never waits.

        Returns something true if it is still busy sending: to be called again in the next pass.
        """
        raise NotImplementedError


class Dmx:
    """Puts light levels on a wire.

    channels    512, or 0 if there is no DMX
    """

    def show(self, lights):
        """Send the levels of an io.lights.Lights if any has changed. At most once a pass."""
        raise NotImplementedError


class Watchdog:
    """Restarts the board unless it is fed.

    caused_reset    whether it has started the board this time
    """

    def arm(self, ms):
        """Start it. It has to be fed within `ms` milliseconds from now on.

        It feeds itself while something other than a pass holds up the main loop, once the tick has
        brought all motors to rest.
        """
        raise NotImplementedError

    def feed(self):
        """Feed it. Only while it is armed."""
        raise NotImplementedError

    def disarm(self):
        """Stop it: it need not be fed any more."""
        raise NotImplementedError


class DriverWire:
    """The UART of the motors' drivers."""

    def select(self, motor):
        """Select the driver of a motor (from 0), if each has a line of its own."""
        raise NotImplementedError

    def send(self, buffer, count):
        """Send up to 8 bytes. Never waits."""
        raise NotImplementedError

    def receive(self, buffer, at, limit):
        """Put received bytes, at most `limit`, into buffer[at:]. Returns how many.

        What was sent is received as well.
        """
        raise NotImplementedError


class Flash:
    """Storage that outlives a power cut, for io/position_journal.py.

    blocks      how many, at least 2
    bytes       of a block
    """

    def read(self, block, at, buffer):
        """Fill the buffer from offset `at` of a block."""
        raise NotImplementedError

    def program(self, block, at, page):
        """Clear the bits that are 0 in the 256 bytes of `page`. False if that is not possible.

        at: offset in the block, a multiple of 256.
        """
        raise NotImplementedError

    def erase(self, block, page):
        """Set all bits of a block. False if that is not possible. page: 256 bytes to work with."""
        raise NotImplementedError
