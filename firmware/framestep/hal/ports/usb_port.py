"""The protocol on a USB serial port of its own, beside the REPL's built-in one (machine.USBDevice).

usb_transfers.py explains how bytes come in and go out, and how the port survives a soft reset.

Callbacks come from MicroPython's scheduler, or within a pass from glance(). They are viper
functions, which allocate nothing and run to their end (neither a Ctrl-C nor a lack of stack ends
them). They own what the driver does; `poll()` and `send()` what the main loop has taken and given.
"""

import select
import struct
import sys
import time
from array import array

from framestep.base.native import addressof, as_word, const, micropython, ptr8, ptr32
from framestep.hal import DEEPEST, QUESTION
from framestep.hal.ports.usb_descriptor import Strings, descriptor
from framestep.hal.ports.usb_transfers import (
    ADDRESS_REGISTER,
    ALIVE,
    ARMED,
    AT,
    BUS,
    BY_DTR,
    DTR,
    END,
    EP_IN,
    EP_OUT,
    FILL,
    FLAG,
    HELD,
    INSIDE,
    KEPT,
    KEPT_AT,
    KEPT_DTR,
    KEPT_FILL,
    KEPT_MARK,
    LAST,
    LEAVE,
    LEFT,
    LIVE,
    LOOK,
    MARK_0,
    MEMORY,
    NEXT,
    NO,
    NO_FLAG,
    OBJECT,
    OUTGOING,
    PACKET,
    PACKET_AT,
    PLACE,
    RX,
    SEEN,
    SENDING,
    SENT,
    STALE,
    TAKE,
    TX,
    UNCHANGED,
    UNHEARD,
    USED,
    VIEW,
    WAITS,
    WORDS,
    YES,
    activate,
    arm,
    arrived,
    begin_stops,
    chip,
    drop_stale,
    forget_host,
    look,
    mark_stale,
    reply,
    restore,
    send_packet,
)

# isort: split
# After usb_transfers, which explains what to do if this is missing
import micropython as runtime
from machine import USBDevice, disable_irq, enable_irq

# CDC requests (USB CDC PSTN 1.2, table 13)
_SET_LINE_CODING = const(0x20)
_GET_LINE_CODING = const(0x21)
_SET_CONTROL_LINE_STATE = const(0x22)
_SEND_BREAK = const(0x23)
_STAGE_SETUP = const(1)

# Types of requests that are carried out at once (protocol.messages)
_HI = const(0x01)
_STATUS = const(0x30)
_STOP = const(0x32)  # STOP_ALL is between this and _GET_POSITION
_GET_POSITION = const(0x34)
_SECTION = const(0x101)  # of an uploaded move
_GO = const(0x113)

# bytes that come this long after DTR was cleared come from a host that does not use it
_QUIET_MS = const(100)
_SETTLE_MS = const(2)
# the driver of a host that has the port open collects a packet within this time
_COLLECT_MS = const(500)


class UsbPort:
    """The protocol's port.

    `open`: a host has it open. It has set DTR or, if it does not use DTR, sent bytes. `openings`
    counts how often it was opened: a change means a new client, even if `open` is True before and
    after.

    `answer`: answer(buffer, at, to) -> size, a kernel that answers a question for status, positions
    or HI as soon as it has come, if nothing else is to be sent, stores a section, starts a motion
    at a GO, and begins a stop. False by default.

    `struck`: a Ctrl-C for the REPL has come during glance(). Whoever makes the passes clears this,
    and passes it on.

    Nothing allocates after `start()`. One main loop calls `poll()` and `send()`. If it is a
    scheduled function, it calls `poll()` only once each time, since callbacks must come between two
    calls.
    """

    def __init__(self):
        usb = self._usb = USBDevice()
        builtin = self._builtin = usb.BUILTIN_DEFAULT
        self._submit = usb.submit_xfer
        memory = memoryview(chip.memory(MEMORY) if chip else bytearray(MEMORY))
        self._rx = memory[: 2 * PLACE]
        self._places = (memory[:PLACE], memory[PLACE : 2 * PLACE])
        at = 2 * PLACE
        self._tx = memory[at : at + OUTGOING]
        at += OUTGOING
        packet = self._packet = memory[at : at + PACKET]
        at += PACKET
        self._coding = memory[at : at + 7]  # only stored for the host
        self._coding[:] = struct.pack("<IBBB", 115200, 0, 0, 8)
        s = self._state = array("i", [0] * WORDS)
        s[EP_OUT] = builtin.ep_max + 1
        s[EP_IN] = 0x80 | s[EP_OUT]
        s[RX] = as_word(addressof(self._rx))
        s[TX] = as_word(addressof(self._tx))
        s[BUS] = as_word(ADDRESS_REGISTER)
        s[PACKET_AT] = as_word(addressof(packet))
        s[VIEW] = as_word(id(packet))
        s[NO_FLAG] = UNCHANGED
        s[FLAG] = as_word(addressof(s)) + 4 * NO_FLAG
        s[KEPT] = as_word(addressof(memory)) + KEPT_AT
        s[USED] = s[USED + 1] = PLACE
        self._closed_at = time.ticks_ms()
        s[WAITS] = -1
        self._waits_since = 0
        self._bus = chip.BusWatch() if chip else None
        self.open = False
        self.openings = 0
        self.answer = False
        self.struck = False
        self._writer = None
        if chip:
            # Not in start(): by then the module is unloaded, and to load it again would leave a
            # hole in front of the memory for moves.
            from framestep.hal.rp2.stack import unchecked

            port = UsbPort
            self._kinds = unchecked(
                arm,
                mark_stale,
                send_packet,
                _at_once,
                begin_stops,
                port._configured,
                port._reset,
                port._control,
                port._transferred,
            )
            # Polling the REPL's port runs MicroPython's USB task, even in a scheduled function.
            poller = select.poll()
            poller.register(sys.stdin, 0)
            self._task = poller.ipoll
            self._task(0)  # the first one allocates

    def start(self):
        """Add the port to the built-in one; returns at once.

        The host sees the board disappear and come back with two ports. After a soft reset it sees
        nothing.
        """
        usb = self._usb
        going_on = chip and chip.enabled(self._state[EP_OUT]) and restore(self._state, id(usb))
        if not going_on:
            usb.active(False)
        usb.builtin_driver = self._builtin  # type: ignore[attr-defined]
        usb.config(
            self._builtin.desc_dev,
            descriptor(self._builtin),
            Strings(self._builtin.str_max),
            self._configured,
            self._reset,
            self._control,
            self._transferred,
        )
        if going_on:
            self._go_on()
        else:
            activate(self._state, usb, id(usb), bytearray(OBJECT))

    def _go_on(self):
        """Go on after a soft reset, which the host has not noticed: a new session begins.

        The port may be open. The end of a transfer in between was reported to nobody.
        """
        state = self._state
        time.sleep_ms(_SETTLE_MS)  # for reports that are still due from MicroPython's USB task
        irq = disable_irq()
        try:
            if not chip.in_flight(state[EP_OUT], 1):
                state[ARMED] = 0
            if not chip.in_flight(state[EP_OUT], 0):
                state[SENDING] = 0
        finally:
            enable_irq(irq)
        mark_stale(state)
        if state[SENDING]:
            chip.empty_packet(state[EP_OUT])
        elif state[DTR]:
            try:
                send_packet(self)  # an empty one
            except OSError:  # the last one ends just now
                pass
        if state[LIVE] and not state[ARMED]:
            try:
                arm(self)
            except OSError:  # it ends just now
                state[ARMED] = 1
        if state[DTR]:
            self.open = True
            self.openings += 1

    # ------------------------------------------------------------ callbacks of the USB driver

    @micropython.viper
    def _configured(self, descriptor):
        s = ptr32(self._state)
        s[LIVE] = 1
        s[ARMED] = 0
        s[SENDING] = 0
        flag = ptr8(s[FLAG])
        if flag[1] == 0:
            flag[0] = 0
            kept = ptr32(s[KEPT])
            kept[KEPT_FILL] = s[FILL]
            kept[KEPT_DTR] = s[DTR]
            kept[KEPT_MARK] = ALIVE
        if (s[FILL] - s[TAKE]) & 3 < 2:
            arm(self)

    @micropython.viper
    def _reset(self):
        # A bus reset or another configuration ends all transfers. Keep what has arrived of the
        # running one.
        s = ptr32(self._state)
        if s[ARMED]:
            place = s[FILL] & 1
            s[END + place] = s[SEEN]
            s[USED + place] = PLACE
            s[FILL] = (s[FILL] + 1) & 3
            s[ARMED] = 0
        s[LIVE] = 0
        s[SENDING] = 0
        ptr32(s[KEPT])[KEPT_MARK] = 0
        mark_stale(s)
        s[DTR] = 0
        s[UNHEARD] = 0
        s[BY_DTR] = 1
        self.open = False
        self._closed_at = time.ticks_ms()

    @micropython.viper
    def _control(self, stage: int, request):
        if stage != _STAGE_SETUP:
            return YES
        setup = ptr8(request)
        what = setup[1]
        if setup[0] & 0x60 != 0x20:  # class requests only
            return NO
        s = ptr32(self._state)
        dtr = setup[2] & 1
        if what == _SET_LINE_CODING or what == _SET_CONTROL_LINE_STATE:
            if what == _SET_LINE_CODING:
                dtr = s[DTR]
            if what == _SET_CONTROL_LINE_STATE and s[UNHEARD]:
                s[UNHEARD] = 0
                if dtr:  # set by a host that opens the port
                    s[DTR] = 0
            if dtr > s[DTR]:
                mark_stale(s)
                if chip and s[SENDING]:
                    chip.empty_packet(s[EP_OUT])
                self.open = True
                self.openings = int(self.openings) + 1
            elif dtr < s[DTR] or dtr == 0 and self.open:
                # Without DTR, the line coding that drivers set when a program opens or closes the
                # port is the only sign of either.
                mark_stale(s)
                if chip and s[SENDING]:
                    chip.empty_packet(s[EP_OUT])
                self.open = False
                self._closed_at = time.ticks_ms()
                s[BY_DTR] = s[DTR]
            s[DTR] = dtr
            ptr32(s[KEPT])[KEPT_DTR] = dtr
        if what == _SET_LINE_CODING or what == _GET_LINE_CODING:
            return self._coding
        if what == _SET_CONTROL_LINE_STATE:
            return YES
        if what == _SEND_BREAK:
            return YES
        return NO

    @micropython.viper
    def _transferred(self, endpoint: int, result: int, count: int) -> bool:
        s = ptr32(self._state)
        stops = -1  # the slot where they may be
        if endpoint == s[EP_OUT]:
            place = s[FILL] & 1
            s[END + place] = count
            s[USED + place] = count
            s[FILL] = (s[FILL] + 1) & 3
            ptr32(s[KEPT])[KEPT_FILL] = s[FILL]
            s[ARMED] = 0
            frame = ptr8(s[RX] + place * PLACE)
            kind = frame[6] | (frame[7] << 8)
            if (
                QUESTION + frame[8] + (frame[9] << 8) != count
                or kind >= _STOP
                and kind < _GET_POSITION
            ):
                stops = place
            # A host sends sections without waiting, but its next question after the answer.
            if frame[7] and (s[FILL] - s[TAKE]) & 3 < 2:
                arm(self)
        elif endpoint == s[EP_IN]:
            if s[LEFT] or s[LAST] == PACKET:
                send_packet(self)
            else:
                s[SENDING] = 0
        now = 0 if s[LEFT] | s[SENDING] else s[HELD]
        if s[TAKE] != s[FILL]:
            place = s[TAKE] & 1
            at = s[AT]
            if at == s[END + place]:  # perhaps it was answered by glance()
                now = 1
            else:
                frame = ptr8(s[RX] + place * PLACE + at)
                kind = frame[6] | (frame[7] << 8)
                if kind == _SECTION:
                    now = 1 - s[INSIDE]
                elif kind == _GO:
                    now = 1
                elif s[SENDING]:
                    pass
                elif kind == _STATUS or kind == _GET_POSITION or kind == _HI:
                    now = 1
        # A program on the REPL may have taken so much of the stack that there is no room for more
        # here; then the next pass sees to it, as it does to everything else.
        if self.answer and (now or stops >= 0) and s[STALE] == 0:
            if s[INSIDE] or int(runtime.stack_use()) <= DEEPEST:
                if stops >= 0 and self.open:
                    at = stops * PLACE
                    begin_stops(self, at, at + s[AT] if stops == s[TAKE] & 1 else at, at + count)
                if now:
                    _at_once(self)
        if s[LIVE] and not s[ARMED] and (s[FILL] - s[TAKE]) & 3 < 2:
            arm(self)
        return True

    # ------------------------------------------------------------ for the main loop

    @micropython.viper
    def poll(self, reader) -> int:
        """Offer received bytes to `reader.feed(buffer, start, count) -> taken`. Return how many it
        took.

        Bytes that are not taken are offered again by the next call. Once both slots are full, the
        host has to wait.
        """
        s = ptr32(self._state)
        look = (s[LOOK] + 1) & 0xFFFFFFF
        s[LOOK] = look
        moved = 0
        wanted = 1 if self.open else 0
        if s[STALE]:
            drop_stale(s)
            if not s[ARMED] and s[LIVE] and (s[FILL] - s[TAKE]) & 3 < 2:
                arm(self)
        while True:
            place = s[TAKE] & 1
            at = s[AT]
            ended = s[TAKE] != s[FILL]
            if ended:
                end = s[END + place]
            elif moved:
                break  # the next call finds the transfer complete, and the reader empty
            else:
                end = int(arrived(s, look))
                if at == 0 and end > s[LEAVE]:
                    frame = ptr8(s[RX] + place * PLACE)
                    if frame[6] | (frame[7] << 8) == _SECTION:
                        s[LEAVE] = end  # it is stored once it is there; a pass would copy it first
                        break
            if at < end:
                if wanted == 0:
                    wanted = 1 if self._heard() else -1
                taken = end - at
                if wanted > 0:
                    if not ended:  # else the callback has looked for stops
                        self.look_for_stop()
                    taken = int(reader.feed(self._rx, place * PLACE + at, taken))
                at += taken
                s[AT] = at
                moved += taken
            if at < end or not ended:
                break
            s[AT] = 0
            s[TAKE] = (s[TAKE] + 1) & 3
            if not s[ARMED] and s[LIVE]:
                arm(self)
        if wanted < 0:
            return 0
        packet = ptr32(s[RX] + (s[FILL] & 1) * PLACE)
        kind = packet[1] >> 16  # neither a GO nor a section may wait for this
        if s[ARMED] and packet[0] != MARK_0 and kind != _SECTION and kind != _GO:
            self.look_for_stop()  # in a short packet, which waits for its callback, or a later one
        if moved == 0 and look & 15 == 0:
            if s[LIVE] and not s[ARMED] and s[TAKE] == s[FILL]:
                # an exception has ended the callback that should have done this
                arm(self)
            self._watch()
        return moved

    @micropython.viper
    def send(self, writer) -> int:
        """Begin to send what `writer.take(buffer, limit) -> count` provides. Never waits.

        Return 1 if it is still busy sending; nothing is taken then. While the port is closed,
        everything is dropped, as in any serial port.
        """
        s = ptr32(self._state)
        if self.open:
            if s[STALE]:  # a new session has begun in this pass; the next one drops what is here
                return 1
            if s[SENDING]:
                s[HELD] = 1
                self._writer = writer
                return 1
            count = int(writer.take(self._tx, OUTGOING))
            if count:
                s[LEFT] = count
                s[NEXT] = s[TX]
                send_packet(self)
        else:
            while int(writer.take(self._tx, OUTGOING)):
                pass
        return 0

    @micropython.viper
    def glance(self):
        """Answer a question, carry out a GO, or begin a stop that has come since the pass began. Or
        if the last answer has gone, let MicroPython's USB task run, whose callbacks send the rest
        of it, answer a further question, and let the next one come. Called where the pass has
        nothing half done.

        Sections of an uploaded move are left to the task, since storing one takes long.
        """
        if not chip:
            return
        s = ptr32(self._state)
        stops = s[SENDING]  # until the last answer has gone, there is no room for another one
        if stops and not chip.in_flight(s[EP_OUT], 0):
            s[INSIDE] = 1
            self._run_task()
            s[INSIDE] = 0
        if s[ARMED]:  # here and not in look(), as a call takes longer than this
            packet = ptr32(s[RX] + (s[FILL] & 1) * PLACE)
            if packet[0] != MARK_0 and packet[1] >> 16 != _SECTION:
                look(self, stops)

    @micropython.viper
    def look_for_stop(self):
        """As glance(), but begin a stop only. Called where a report or a request is half done."""
        s = ptr32(self._state)
        if chip and s[ARMED]:
            packet = ptr32(s[RX] + (s[FILL] & 1) * PLACE)
            if packet[0] != MARK_0 and packet[1] >> 16 != _SECTION:
                look(self, 1)

    def _run_task(self):
        """Run MicroPython's USB task. It keeps a Ctrl-C that has come on the REPL's port for the
        next branch, which is here, and not later in the pass."""
        try:
            if self._task(0):
                pass
        except KeyboardInterrupt:
            self.struck = True

    # ------------------------------------------------------------ openings and closings

    def _heard(self):
        """Return whether bytes that came in through a closed port count.

        They do not if the host has just cleared DTR, as it may have sent them before. Otherwise
        this host does not use DTR, and has the port open now.
        """
        if self._state[BY_DTR] and time.ticks_diff(time.ticks_ms(), self._closed_at) <= _QUIET_MS:
            return False
        self.open = True
        self.openings += 1
        return True

    def _lose(self):
        """Drop what is under way, as the host has gone without clearing DTR."""
        state = self._state
        state[LEFT] = 0
        state[LAST] = 0
        state[HELD] = 0
        chip.empty_packet(state[EP_OUT])
        self.open = False
        self._closed_at = time.ticks_ms()

    def _watch(self):
        """Close the port if the bus is dead. Open it when the host is back and still has DTR
        set."""
        if chip:
            state = self._state
            if self._bus.dead():
                if self.open:
                    self._lose()
            elif state[UNHEARD] == 2 and not state[SENDING]:
                state[UNHEARD] = 1
            elif (
                self.open
                and (state[UNHEARD] == 2 or not state[DTR])
                and state[SENDING]
                and chip.packet_waits(state[EP_OUT])
            ):
                now = time.ticks_ms()
                if state[SENT] != state[WAITS]:
                    state[WAITS] = state[SENT]
                    self._waits_since = now
                elif time.ticks_diff(now, self._waits_since) > _COLLECT_MS:
                    self._lose()  # the host does not use DTR, or it was not noticed
                    forget_host(state)
                    mark_stale(state)
            elif not self.open and self._state[DTR]:
                self.open = True
                self.openings += 1


@micropython.viper
def _at_once(port):
    """Send what could not be sent before. Answer the question, store the section, or carry out the
    GO, that has come."""
    s = ptr32(port._state)
    if s[HELD] and s[SENDING] == 0:
        s[HELD] = 0
        port.send(port._writer)
    if s[TAKE] == s[FILL] or not port.open:
        return
    place = s[TAKE] & 1
    at = s[AT]
    if at < s[END + place]:
        left = s[END + place] - at
        if left < QUESTION:
            return
        frame = ptr8(s[RX] + place * PLACE + at)
        if left < QUESTION + frame[8] + (frame[9] << 8):
            return
        if s[LEFT] or s[SENDING] and frame[7] == 0:
            return
        if int(reply(port, place * PLACE + at)) == 0:
            return
        at = s[AT]
    if at == s[END + place]:
        s[AT] = 0
        s[TAKE] = (s[TAKE] + 1) & 3
        if not s[ARMED] and s[LIVE]:
            arm(port)
