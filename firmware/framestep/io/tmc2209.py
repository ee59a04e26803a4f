"""TMC2209 drivers on their one-wire UART: sets them up before they are enabled, and watches for
faults.

Telegrams (TMC2209 datasheet, "UART single wire interface"), each byte with its lowest bit first:

    write    05, address, register | 80, four bytes of value (highest first), CRC
    read     05, address, register, CRC;  answer  05, FF, register, four bytes of value, CRC

What is sent comes back as an echo, since TX and RX share the wire. An answer differs from the echo,
and from noise, by its address FF and its CRC. A write has no answer, so IFCNT, which counts good
writes, is read after each one.

A driver that does not answer, has a fault, or was reset by a drop of its supply is not `ready`: its
motor does not move. It is asked again every RETRY_MS, and set up from the beginning once it
answers. A pass of the main loop does one thing and never waits. Nothing allocates after
construction.
"""

from array import array

from framestep.base.clock import after, elapsed
from framestep.base.native import const, micropython, ptr8

POLL_MS = const(50)  # from the check of one driver to the next
RETRY_MS = const(1000)
PATIENCE_MS = const(8)  # an answer takes 1.3 ms
TRIES = const(4)
OPEN_CHECKS = const(3)  # checks in a row, in motion, before an open load is reported
_WRITTEN_MS = const(2)  # a write is on the wire for 0.7 ms

_ENTRY = const(5)  # bytes of a register in a table
_ANSWER = const(8)
_HEARD = const(32)

# Registers that are read
_GSTAT = const(0x01)
_IFCNT = const(0x02)
_DRV_STATUS = const(0x6F)

# Flags of a driver: bits 0 to 7 of DRV_STATUS, then the three of GSTAT
HOT = const(1)
TOO_HOT = const(2)
SHORT = const(0x3C)  # to ground or to the supply, phase A or B
OPEN = const(0xC0)  # phase A or B
RESET = const(0x100)
STOPPED = const(0x200)  # drv_err: too hot, or a short
LOW_SUPPLY = const(0x400)  # uv_cp: the charge pump has too little voltage
FAULTS = const(0x73E)  # TOO_HOT | SHORT | RESET | STOPPED | LOW_SUPPLY
# Flags that this module adds
SILENT = const(0x800)
NO_ECHO = const(0x1000)
DEAF = const(0x2000)  # it answers, but does not accept writes
_TROUBLE = const(0x3F3E)  # FAULTS | SILENT | NO_ECHO | DEAF

# texts, causes first: of several flags only the first one is reported
WORDS = (
    (NO_ECHO, "gets no echo on the wire: RX, TX and PDN_UART are not connected"),
    (SILENT, "does not answer (check its power and its address)"),
    (DEAF, "answers, but does not take its settings"),
    (TOO_HOT, "has switched off, too hot"),
    (SHORT, "has switched off: a short in the motor or its cable"),
    (LOW_SUPPLY, "has too little supply voltage"),
    (RESET, "was reset: its supply broke down"),
    (STOPPED, "has switched off"),
)
HOT_WORDS = "is hot, close to switching off"
OPEN_WORDS = "finds no motor on one of its coils"
WORKS_WORDS = "works again"

# Phases of an exchange
_REST = const(0)
_WRITTEN = const(1)
_ASKED = const(2)

_BASE = const(-1)  # first step of a set-up: IFCNT before the first write

# States of a driver
_NEW = const(0)
_WORKS = const(1)
_FAILED = const(2)


@micropython.viper
def crc(data: ptr8, at: int, count: int) -> int:
    """Return a telegram's CRC-8: polynomial x⁸ + x² + x + 1, each byte from its lowest bit on."""
    result = 0
    i = at
    end = at + count
    while i < end:
        byte = data[i + 0]
        bit = 0
        while bit < 8:
            if (result >> 7) ^ (byte & 1):
                result = ((result << 1) ^ 0x07) & 0xFF
            else:
                result = (result << 1) & 0xFF
            byte >>= 1
            bit += 1
        i += 1
    return result


@micropython.viper
def _start(data: ptr8, at: int, count: int, register: int) -> int:
    """Return where from `at` on a complete answer about this register may begin, or -1."""
    last = count - _ANSWER
    while at <= last:
        if data[at + 2] == register:
            if data[at + 1] == 0xFF:
                if data[at + 0] & 0x0F == 5:
                    return at
        at += 1
    return -1


def answer(heard, count, register):
    """Return where in `count` bytes the answer about a register begins, or -1 if it is not there
    yet."""
    at = _start(heard, 0, count, register)
    while at >= 0 and crc(heard, at, _ANSWER - 1) != heard[at + _ANSWER - 1]:
        at = _start(heard, at + 1, count, register)
    return at


class Drivers:
    """The drivers for which the rig file has settings.

    ready     motors that may be switched on, one bit each, including those without driver settings
    """

    def __init__(self, hal, rig):
        """hal: for its driver_wire. rig.drivers: each motor's registers (io/tmc2209_setup.py) or
        None."""
        self.wire = hal.driver_wire
        self.report_driver = hal.report_driver
        self.motors = bytes([i for i in range(min(hal.motors, len(rig.drivers))) if rig.drivers[i]])
        self.tables = [rig.drivers[i] for i in self.motors]
        self.addresses = bytes([hal.board["drivers"]["address"][i] for i in self.motors])
        self.count = len(self.motors)
        self.flags = array("i", [0] * self.count)  # present flags
        self.reported = array("i", [0] * self.count)  # flags that have been reported
        self.opens = bytearray(self.count)
        self.states = bytearray(self.count)  # _NEW
        self.failed_at = array("i", [0] * self.count)
        bits = 0
        for motor in self.motors:
            bits |= 1 << motor
        self.good = ((1 << hal.motors) - 1) & ~bits
        self.ready = 0 if self.count else self.good  # until each driver has been tried once
        self.writes = 0  # confirmed writes, modulo 2^29
        self._steps = len(self.tables[0]) // _ENTRY if self.count else 0
        self._frame = bytearray(_ANSWER)
        self._heard = bytearray(_HEARD)
        self._filled = 0
        self._phase = _REST
        self._register = 0
        self._at = 0  # time at which this phase began
        self._rest_ms = 0
        self._tries = 0
        self._again = 0
        self._driver = 0
        self._step = _BASE
        self._confirmed = 0
        self._gstat = 0
        self._echo = False
        self.wire.select(self.motors[0])

    # ---------------------------------------------------------------- the wire

    def poll(self, now):
        """Do one pass. now: milliseconds modulo 2^29.

        Return the motors whose driver has just failed, one bit each.
        """
        waited = elapsed(now, self._at)
        if self._phase == _REST:
            if waited >= self._rest_ms:
                self._go_on(now)
            return 0
        if self._phase == _WRITTEN:
            if waited >= _WRITTEN_MS:
                self._ask(_IFCNT, now)
            return 0
        heard = self._heard
        count = self._filled + self.wire.receive(heard, self._filled, _HEARD - self._filled)
        if count > self._filled:
            self._filled = count
            self._echo = True
            at = answer(heard, count, self._register)
            if at >= 0:
                self._rest(now, 1)
                self._tries = 0
                return self._answered(at + 3, now)
        if waited < PATIENCE_MS:
            return 0
        self._tries += 1
        if self._tries < TRIES:
            self._ask(self._register, now)
            return 0
        self._rest(now, 1)
        return self._finish(SILENT if self._echo else NO_ECHO, now)

    def _rest(self, now, ms):
        self._phase = _REST
        self._at = now
        self._rest_ms = ms

    def _ask(self, register, now):
        """Send a read request."""
        wire = self.wire
        wire.receive(self._heard, 0, _HEARD)  # drop the echo of a write, and late answers
        self._filled = 0
        frame = self._frame
        frame[0] = 5
        frame[1] = self.addresses[self._driver]
        frame[2] = register
        frame[3] = crc(frame, 0, 3)
        self._register = register
        self._phase = _ASKED
        self._at = now
        wire.send(frame, 4)

    def _write(self, step, now):
        """Send the write of step `step` in the driver's table."""
        frame = self._frame
        table = self.tables[self._driver]
        at = step * _ENTRY
        frame[0] = 5
        frame[1] = self.addresses[self._driver]
        frame[2] = table[at] | 0x80
        for i in range(1, _ENTRY):
            frame[2 + i] = table[at + i]
        frame[7] = crc(frame, 0, 7)
        self._phase = _WRITTEN
        self._at = now
        self.wire.send(frame, _ANSWER)

    # ---------------------------------------------------------------- one driver

    def _go_on(self, now):
        """Begin the next exchange."""
        step = self._step
        if step == _BASE:
            n = self._driver
            if self.states[n] == _FAILED and elapsed(now, self.failed_at[n]) < RETRY_MS:
                self._next(now)
                return
            self._again = 0
            self._ask(_IFCNT, now)
        elif step < self._steps:
            self._write(step, now)
        else:
            self._ask(_GSTAT if step == self._steps else _DRV_STATUS, now)

    def _next(self, now):
        """Go on to the next driver."""
        n = self._driver + 1
        if n == self.count:
            n = 0
            self.ready = self.good  # all have been tried
        self._driver = n
        self.wire.select(self.motors[n])
        self._tries = 0
        self._echo = False
        self._step = self._steps if self.states[n] == _WORKS else _BASE
        self._rest(now, 1 if self.states[n] == _NEW else POLL_MS)

    def _answered(self, at, now):
        """Read a register's value, four bytes from heard[at] on."""
        heard = self._heard
        last = heard[at + 3]
        step = self._step
        if step == self._steps:
            self._gstat = last & 7
            self._step = step + 1
        elif step > self._steps:
            if heard[at] & 0x80 or not last & OPEN:  # at rest the chip does not detect it reliably
                self.opens[self._driver] = 0
            elif self.opens[self._driver] < OPEN_CHECKS:
                self.opens[self._driver] += 1
            return self._finish(last | (self._gstat << 8), now)
        elif step == _BASE:
            self._confirmed = last
            self._step = 0
        elif last == (self._confirmed + 1) & 0xFF:
            self._confirmed = last
            self.writes = after(self.writes, 1)
            self._again = 0
            self._step = step + 1
        else:
            # The same count: the write was lost; repeat it. A different one: the driver was reset.
            if last != self._confirmed:
                self._confirmed = last
                self._step = 0
            self._again += 1
            if self._again == TRIES:
                return self._finish(DEAF, now)
        return 0

    def _finish(self, flags, now):
        """Record the driver's flags, and go on to the next driver.

        Return its motor's bit if the driver has failed, else 0.
        """
        n = self._driver
        motor = self.motors[n]
        self.flags[n] = flags
        worked = self.states[n] == _WORKS
        failed = 0
        if flags & _TROUBLE:
            self.states[n] = _FAILED
            self.failed_at[n] = now
            self.good &= ~(1 << motor)
            self.ready &= self.good
            if worked:
                failed = 1 << motor
        elif not worked:
            self.states[n] = _WORKS
            self.good |= 1 << motor
        self._report(n, motor, flags, worked)
        self._next(now)
        return failed

    def _report(self, n, motor, flags, worked):
        """Report what is new."""
        reported = self.reported[n]
        if flags & _TROUBLE:
            # of several flags the first in WORDS is the cause
            for i in range(len(WORDS)):
                if flags & WORDS[i][0]:
                    if worked or not reported & WORDS[i][0]:
                        self.report_driver(motor + 1, WORDS[i][1])
                    reported = WORDS[i][0]
                    break
        else:
            if reported & _TROUBLE:
                self.report_driver(motor + 1, WORKS_WORDS)
                reported &= ~_TROUBLE
            if flags & HOT and not reported & HOT:
                self.report_driver(motor + 1, HOT_WORDS)
            if self.opens[n] == OPEN_CHECKS and not reported & OPEN:
                self.report_driver(motor + 1, OPEN_WORDS)
                reported |= OPEN
            elif not flags & OPEN and self.opens[n] == 0:
                reported &= ~OPEN
            reported = (reported & ~HOT) | (flags & HOT)
        self.reported[n] = reported

    def states_in_words(self):
        """Return a line for each driver, for the REPL. Allocates."""
        lines = []
        for n in range(self.count):
            text = "is being set up" if self.states[n] == _NEW else "works"
            if self.states[n] == _WORKS and self.flags[n] & HOT:
                text = HOT_WORDS
            for bits, words in WORDS:
                if self.states[n] == _FAILED and self.reported[n] & bits:
                    text = words
            lines.append("driver of motor %d %s" % (self.motors[n] + 1, text))
        return lines
