"""Classes that a HAL has to provide. docs/internals/new-chip.md says how to write one.

This module is not put on a board, so a HAL does not inherit from it.
host_tests/hal/test_contract.py checks that every HAL has these names and parameters, and that
nothing above the HAL uses others. After Hal.start() nothing allocates.

engine.py has what the tick needs to know of the chip's pulse engine.
"""


class Hal:
    """A board, made once at boot from its data and a framestep.rig.Rig. The drivers are off at
    first.

    motors          how many there are
    board           the board's data: boards/<board>/board.json as a dictionary, with the changes by
                    this rig file
    kernel          pulse.kernel.StepKernel; it ticks after start()
    engine          a PulseEngine
    port            the Port of the protocol
    dmx             a Dmx
    watchdog        a Watchdog
    driver_wire     the DriverWire, unless Rig.drivers is None
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
        """Hold the tick off for some microseconds. Return the state for irq_on()."""
        raise NotImplementedError

    def irq_on(self, state):
        """Let the tick come again. state: the result of irq_off()."""
        raise NotImplementedError

    def idle(self):
        """Wait for the next interrupt, as there is nothing to do."""
        raise NotImplementedError

    def enable(self, motor, on):
        """Switch a motor's driver on or off; for a servo, its pulses. Drivers that share a pin are
        on while any of them is."""
        raise NotImplementedError

    def led(self, colour):
        """Light the board's LED in a colour 0xRRGGBB, as far as it has one; 0: off."""
        raise NotImplementedError

    def output(self, pin, level):
        """Make a pin an output, at boot. Return its bit for drive(), below 2^30."""
        raise NotImplementedError

    def input(self, pin, pull):
        """Make a pin an input, at boot. Return its bit in levels(), below 2^30.

        pull: "up", "down" or "none".
        """
        raise NotImplementedError

    def drive(self, high, low):
        """Drive the pins of these bits high and low, all at once. Interrupt handlers may call
        it."""
        raise NotImplementedError

    def levels(self):
        """Return the inputs that are high, one bit each; outputs too if all pins are alike."""
        raise NotImplementedError

    def pass_callback(self, work):
        """Make a callback of one argument that runs work, which is a pass, from MicroPython's
        scheduler: with the whole stack, however much of it a program on the REPL uses, and with
        inside[PASS] at 1. Allocates."""
        raise NotImplementedError

    def watch(self, bits, handler):
        """Call handler(x) from a hard interrupt when one of these inputs changes. At boot, once
        for each input."""
        raise NotImplementedError

    def align(self):
        """Let the next tick come 1 ms from now, and a pass just after it, if the engine's ticks can
        be moved. The port calls it, by answer(), while nothing moves and no cue waits."""
        raise NotImplementedError

    def take_lost_commands(self):
        """Return the motors, one bit each, that have lost commands since the last call.

        Steps of these motors are missing.
        """
        raise NotImplementedError

    def reclaim(self):
        """Take back pins that something else, such as a program on the REPL, has changed.

        Return -1 if there were none, else the motors that may have missed pulses, one bit each.
        """
        raise NotImplementedError

    def ready(self):
        """Return False while the chip may let go of a pin, as the RP2040 B1 does after a reset of
        the USB bus.

        Nothing must start then.
        """
        raise NotImplementedError

    def clock_kept(self):
        """Return whether the clock that times the pulses is as at the start."""
        raise NotImplementedError

    def quiet(self):
        """Return whether nothing may be printed unasked, as a tool uses the REPL's raw mode."""
        raise NotImplementedError

    def flash(self):
        """Make a Flash, at boot. Raises OSError if there is none."""
        raise NotImplementedError


class Start:
    """Module hal/<hal>/start.py: what framestep.boot does differently on each chip. It is loaded
    first, and unloaded once the board is up.

    SPENT   modules that are no longer needed then, itself included
    SPARE   bytes of the heap for the REPL and a user's own code, in one piece
    """

    def clear():  # type: ignore[misc]
        """Stop what a soft reset leaves running. Called first."""
        raise NotImplementedError

    def held(board):
        """Return why framestep must not start, as text (a button is held, the jumper is set), or
        None. board: the data of boards/<board>/board.json."""
        raise NotImplementedError

    def drivers_off(board, rig):
        """Switch all drivers off. board: the board's data, as the rig file changes it."""
        raise NotImplementedError

    def prepare(board):
        """Set the processor's clock and the limit of its stack."""
        raise NotImplementedError

    def make(board, rig):
        """Return the Hal."""
        raise NotImplementedError

    def release(block):
        """Free the memory of a bytearray that is no longer used."""
        raise NotImplementedError


class PulseEngine:
    """Turns the tick's commands into edges; engine.py defines them and how long they take.

    It reports what it cannot do in time by Hal.take_lost_commands(), and never makes up for it by a
    burst of pulses.
    """

    def fifo(self, motor):
        """Return the address for a motor's commands, or of its ring (engine.RING)."""
        raise NotImplementedError


class Port:
    """The protocol's port.

    open        whether the host has it open (DTR); True if that cannot be seen
    openings    how often it has been opened: a change means a new host
    answer      answer(buffer, at, to) -> size: a kernel that the port calls, if it is not the
                REPL's, as soon as a question for status, positions or HI has come to buffer[at:]
                and nothing else is to be sent; it puts the answer into `to`. Set from outside;
                False: passes answer all questions.
    struck      a Ctrl-C for the REPL has come during glance(); whoever makes the passes clears
                this, and passes it on. Only if the port is not the REPL's.
    """

    def start(self):
        """Claim the port."""
        raise NotImplementedError

    def stop(self):
        """Give the port back to the REPL, if it is the REPL's."""
        raise NotImplementedError

    def poll(self, reader):
        """Pass received bytes to reader.feed(buffer, start, count). Return how many it took."""
        raise NotImplementedError

    def glance(self):
        """Answer a question that has come since the pass began. Called by pieces of a pass where
        nothing is half done."""
        raise NotImplementedError

    def look_for_stop(self):
        """Begin a stop that has come since the pass began, as far as glance() would. Called where
        something is half done."""
        raise NotImplementedError

    def send(self, writer):
        """Begin to send what writer.take(buffer, limit) provides. Never waits.

        Return something true while it is still busy sending; call it again in the next pass.
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

    caused_reset    whether it has restarted the board this time
    """

    def arm(self, ms):
        """Start it. From now on it has to be fed every `ms` milliseconds.

        While something other than a pass holds up the main loop, it is fed automatically once the
        tick has brought all motors to rest.
        """
        raise NotImplementedError

    def feed(self):
        """Feed it. Only while it is armed."""
        raise NotImplementedError

    def disarm(self):
        """Stop it."""
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
        """Put received bytes, at most `limit`, into buffer[at:]. Return how many.

        Sent bytes are received as well.
        """
        raise NotImplementedError


class Flash:
    """Storage that survives a power cut, for io/position_journal.py.

    blocks      how many, at least 2
    bytes       of a block
    """

    def read(self, block, at, buffer):
        """Fill the buffer from offset `at` of a block."""
        raise NotImplementedError

    def program(self, block, at, page):
        """Clear the bits that are 0 in the 256 bytes of `page`. Return False if that fails.

        at: offset in the block, a multiple of 256.
        """
        raise NotImplementedError

    def erase(self, block, page):
        """Set all bits of a block. Return False if that is impossible. page: 256 scratch bytes."""
        raise NotImplementedError
