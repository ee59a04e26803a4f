"""The protocol on a USB serial port of its own, beside the built-in one that keeps the REPL
(machine.USBDevice).

What comes in. A transfer from the host is 17 packets of 64 bytes long, so that the largest frame
costs one callback and not seventeen. It ends early with a packet that is not full; a frame of a
multiple of 64 bytes has none, and would wait in an unfinished transfer for whatever comes next. So
each packet's place holds a mark while the transfer runs: the USB driver copies a packet to its
place in its interrupt, whole, and what is no longer the mark has arrived. The main loop takes
packets from an unfinished transfer like that, and what is sent is never held up. Two transfers'
places take turns: the next one is begun by the callback that ends the last, as soon as the main
loop has emptied its place.

What goes out goes a packet at a time, from one callback to the next, and always ends with a packet
that is not full (an empty one if need be): hosts wait for that before they hand on what they have
got.

Between the interrupt of a bus reset and TinyUSB's task, which tells it, TinyUSB has forgotten all
endpoints: a transfer submitted to one then ends in panic(), and the processor stops for good. So
the device's address, which that interrupt clears, is looked at before each, with interrupts off
from there to the end of the call.

A soft reset, as mpremote makes one before each of its commands, must not take the device away:
mpremote would find its own port gone. MicroPython disconnects an active USBDevice then, and one
that is not active stays. So the flag that says so is set in MicroPython's object for the time of a
call only. After the soft reset the host's transfers go on, into memory that the heap knows nothing
of (rp2_usb.memory); the next port takes over what is there, with the places, and what has to be
known of them, where they were.

Callbacks come from MicroPython's scheduler and are viper functions: they run to their end (no
Ctrl-C lands in them, no want of stack ends them) and allocate nothing. They own what the driver
does, `poll()` and `send()` own what the main loop has taken and given.
"""

import struct
import sys
import time
from array import array

from framestep.native import addressof, as_word, const, micropython, ptr8, ptr32

try:
    from machine import USBDevice, disable_irq, enable_irq
except ImportError:
    raise ImportError(
        "a serial port of its own for the protocol needs machine.USBDevice, "
        "which this board's MicroPython does not have; "
        'set "ports": 1 in rig.json, '
        "or use MicroPython 1.23 or newer on an RP2040, RP2350 or ESP32-S3"
    )

if sys.platform == "rp2":
    from framestep.hal import rp2_usb as chip
    from framestep.hal.rp2_usb import ADDRESS_REGISTER
else:
    # a cable that is pulled out goes unnoticed, and a new client may get a packet meant for the
    # last
    chip = None
    _one = array("i", [1])
    ADDRESS_REGISTER = addressof(_one)

_PRODUCT_NAME = "framestep"  # what Windows and macOS show, to which the names of ports are nothing
_NAME = "framestep DMC"  # 40 characters at most (MICROPY_HW_USB_DESC_STR_MAX)

# the index of the product's name in MicroPython's device descriptor (USBD_STR_PRODUCT)
_PRODUCT = const(2)
# bits of that register, 0 from a bus reset on until the host has given a new one
_ADDRESS = const(0x7F)
_PACKET = const(64)  # full-speed bulk endpoint
_PLACE = const(1088)  # 17 packets: room for the largest frame, 1048 bytes
_OUTGOING = const(256)  # bytes taken from the writer at a time

# The mark: words 0 and 15 of a packet's place. Only a full packet reaches its last byte.
_MARK_0 = const(0x1B7E35C9)
_MARK_15 = const(0x2B951CE7)
_MARK_LAST = const(0x2B)

# CDC requests (USB CDC PSTN 1.2, table 13)
_SET_LINE_CODING = const(0x20)
_GET_LINE_CODING = const(0x21)
_SET_CONTROL_LINE_STATE = const(0x22)
_SEND_BREAK = const(0x23)
_STAGE_SETUP = const(1)

# As objects, which a viper function cannot make of its own True and False
_YES = True
_NO = False

# State words
_EP_OUT = const(0)
_EP_IN = const(1)
_LIVE = const(2)  # configured by a host
_ARMED = const(3)  # a transfer from the host is under way
_FILL = const(4)  # transfers ended, modulo 4; the next or running one has the place FILL & 1
_TAKE = const(5)  # transfers emptied, modulo 4
_END = const(6)  # of each place: bytes in it, once its transfer has ended
_USED = const(8)  # of each place: bytes from its start that may not hold the mark
_SEEN = const(10)  # bytes of the running transfer known to have arrived, whole packets
_AT = const(11)  # bytes taken from the place that is being emptied
_DOUBT = const(12)  # look at which the packet at SEEN seemed to be a short one
_LOOK = const(13)  # number of this look, 1 ...
_RX = const(14)  # address of the two places
_SENDING = const(15)
_LEFT = const(16)  # bytes in the outgoing buffer that are still to be sent
_NEXT = const(17)  # address of the next of them
_PACKET_AT = const(18)  # address of the packet's buffer
_LAST = const(19)  # length of the packet under way
_TX = const(20)  # address of the outgoing buffer
_DTR = const(21)
_STALE = const(22)  # 1: what had arrived when a session began or ended is to be dropped
_STALE_FILL = const(23)  # FILL at that moment
_STALE_AT = const(24)  # bytes that had arrived of the transfer running then
_BY_DTR = const(25)  # the last close was one of DTR
_BUS = const(27)  # address of the word with the device's address in it
_SENT = const(26)  # packets, modulo 2^28
# address of MicroPython's flag for an active device, and of the one behind it: a change is due
_FLAG = const(28)
_KEPT = const(29)  # address of the words that a soft reset leaves alone
_NO_FLAG = const(30)  # what stands for the flags where they have not been found
_WORDS = const(31)

# Those words
_MARK = const(0)  # the device is live, and stays so over a soft reset: ALIVE
_KEPT_FILL = const(1)
_KEPT_DTR = const(2)
_KEPT_FLAG = const(3)  # distance of the flag from the beginning of MicroPython's object

ALIVE = const(0x1D7A5C3B)  # known to firmware/boot.py, too
_OBJECT = const(256)  # bytes of MicroPython's object that are looked through
_UNCHANGED = const(0x101)  # both flags set: what is done to the first is never done
# in the memory for USB: two places, what goes out, a packet, line coding
KEPT_AT = const(2 * 1088 + 256 + 64 + 8)
_MEMORY = const(KEPT_AT + 16)

# bytes that come this long after DTR has fallen are from a host that does not use it
_QUIET_MS = const(100)
_SETTLE_MS = const(2)
# a host that listens collects a packet within this; its driver does, however busy it is
_COLLECT_MS = const(500)


@micropython.viper
def _arm(port):
    """Let the host send into the next place. Its marks are put back where packets have been."""
    s = ptr32(port._state)
    place = s[_FILL] & 1
    at = s[_RX] + place * _PLACE
    end = at + s[_USED + place]
    while at < end:
        mark = ptr32(at)
        mark[0] = _MARK_0
        mark[15] = _MARK_15
        at += _PACKET
    s[_END + place] = 0
    s[_SEEN] = 0
    s[_DOUBT] = 0
    flag = ptr8(s[_FLAG])
    irq = disable_irq()
    was = flag[0]
    flag[0] = 1
    try:
        if ptr32(s[_BUS])[0] & _ADDRESS and port._submit(s[_EP_OUT], port._places[place]):
            s[_ARMED] = 1
    finally:
        flag[0] = was
        enable_irq(irq)


@micropython.viper
def _arrived(s: ptr32, look: int) -> int:
    """Bytes of the running transfer that have arrived, whole packets."""
    end = s[_SEEN]
    while s[_ARMED] and end < _PLACE:
        packet = ptr32(s[_RX] + (s[_FILL] & 1) * _PLACE + end)
        if packet[15] >> 24 == _MARK_LAST:
            if packet[15] == _MARK_15 and packet[0] == _MARK_0:
                break
            # A short packet, and the callback that tells its length is due; or a full one whose
            # last byte is the mark's. With no callback by the next look it was full.
            if s[_DOUBT] == 0 or s[_DOUBT] == look:
                s[_DOUBT] = look
                break
        s[_DOUBT] = 0
        end += _PACKET
        s[_SEEN] = end
    return end


@micropython.viper
def _part(s: ptr32):
    """A session begins or ends: what has arrived until now is of none any more, and what is under
    way for nobody.

    Of the running transfer that is every packet whose place no longer holds the mark. A host learns
    that the port is open when this has returned, so nothing of the new session has been sent by
    then.
    """
    end = s[_SEEN]
    if s[_ARMED] == 0:
        end = 0
    while s[_ARMED] and end < _PLACE:
        packet = ptr32(s[_RX] + (s[_FILL] & 1) * _PLACE + end)
        if packet[15] == _MARK_15 and packet[0] == _MARK_0:
            break
        end += _PACKET
    s[_STALE] = 1
    s[_STALE_FILL] = s[_FILL]
    s[_STALE_AT] = end
    s[_LEFT] = 0
    s[_LAST] = 0


@micropython.viper
def _drop_stale(s: ptr32):
    s[_STALE] = 0
    while s[_TAKE] != s[_STALE_FILL]:
        s[_TAKE] = (s[_TAKE] + 1) & 3
        s[_AT] = 0
    if s[_AT] < s[_STALE_AT]:
        s[_AT] = s[_STALE_AT]
    if s[_SEEN] < s[_AT] and s[_TAKE] == s[_FILL]:
        s[_SEEN] = s[_AT]
        s[_DOUBT] = 0


@micropython.viper
def _send_packet(port):
    """Send the next 64 bytes, or the rest, or nothing: an empty packet."""
    s = ptr32(port._state)
    if not s[_LIVE]:
        s[_SENDING] = 0
        return
    count = s[_LEFT]
    if count > _PACKET:
        count = _PACKET
    to = ptr32(s[_PACKET_AT])
    source = ptr32(s[_NEXT])
    i = 0
    while i << 2 < count:
        to[i + 0] = source[i + 0]
        i += 1
    s[_NEXT] += count
    s[_LEFT] -= count
    s[_LAST] = count
    s[_SENDING] = 1
    s[_SENT] = (s[_SENT] + 1) & 0xFFFFFFF
    flag = ptr8(s[_FLAG])
    irq = disable_irq()
    was = flag[0]
    flag[0] = 1
    try:
        if ptr32(s[_BUS])[0] & _ADDRESS:
            port._submit(s[_EP_IN], port._packets[count])
    finally:
        flag[0] = was
        enable_irq(irq)


@micropython.viper
def _activate(s: ptr32, usb, at: int, before):
    """Switch the device on, and find the flags in MicroPython's object at an address: what that
    changes in it."""
    flag = ptr8(at)
    kept = ptr8(before)
    i = 0
    while i < _OBJECT:
        kept[i] = flag[i]
        i += 1
    usb.active(_YES)
    i = 0
    while i < _OBJECT and flag[i] == kept[i]:
        i += 1
    if i < _OBJECT and flag[i] == 1 and flag[i + 1] == 1 and kept[i + 1] == 0:
        flag[i] = 0
        off = usb.active()
        flag[i] = 1
        if not off:
            s[_FLAG] = at + i
            ptr32(s[_KEPT])[_KEPT_FLAG] = i


@micropython.viper
def _restore(s: ptr32, at: int) -> int:
    """What was kept over a soft reset; 0 if there is nothing to go on with. at: address of
    MicroPython's object."""
    kept = ptr32(s[_KEPT])
    if kept[_MARK] != ALIVE or not ptr32(s[_BUS])[0] & _ADDRESS:
        return 0
    s[_FLAG] = at + kept[_KEPT_FLAG]
    s[_FILL] = kept[_KEPT_FILL]
    s[_TAKE] = s[_FILL]
    s[_DTR] = kept[_KEPT_DTR]
    s[_BY_DTR] = 1
    s[_LIVE] = 1
    s[_ARMED] = 1
    s[_SENDING] = 1
    return 1


def _descriptor(builtin):
    """The built-in configuration with a second CDC function behind it (USB CDC 1.2, 5.2; USB 2.0
    ECN "IAD")."""
    control = builtin.itf_max
    notify = 0x80 | builtin.ep_max
    out = builtin.ep_max + 1
    name = builtin.str_max
    function = (
        struct.pack("<8B", 8, 11, control, 2, 2, 2, 0, name)  # the two interfaces belong together
        + struct.pack("<9B", 9, 4, control, 0, 1, 2, 2, 0, name)
        + struct.pack("<5B", 5, 0x24, 0, 0x20, 0x01)  # header, CDC 1.20
        + struct.pack("<5B", 5, 0x24, 1, 0, control + 1)  # call management
        + struct.pack("<4B", 4, 0x24, 2, 6)  # abstract control: line coding and state, break
        + struct.pack("<5B", 5, 0x24, 6, control, control + 1)  # union
        + struct.pack("<BBBBHB", 7, 5, notify, 3, 8, 16)
        + struct.pack("<9B", 9, 4, control + 1, 0, 2, 10, 0, 0, name)
        + struct.pack("<BBBBHB", 7, 5, out, 2, _PACKET, 0)
        + struct.pack("<BBBBHB", 7, 5, 0x80 | out, 2, _PACKET, 0)
    )
    whole = bytearray(builtin.desc_cfg) + function
    struct.pack_into("<H", whole, 2, len(whole))
    whole[4] = control + 2  # interfaces
    return whole


class _Strings:
    """String descriptors: the port's name, the device's; None for those that MicroPython has.
    Raises for no index."""

    def __init__(self, index):
        self.index = index

    def __getitem__(self, index):
        if index == _PRODUCT:
            return _PRODUCT_NAME
        return _NAME if index == self.index else None


class UsbPort:
    """The protocol port. `open`: a host has it open (DTR; or, with a host that leaves DTR alone, it
    has sent bytes).

    `openings` counts the times it was opened: a change means a new client, even where `open` is
    True before and after. Nothing allocates after `start()`. `poll()` and `send()` are for one main
    loop, which may itself be a scheduled function; of those only one `poll()` a call, since
    callbacks must come between two.
    """

    def __init__(self):
        usb = self._usb = USBDevice()
        builtin = self._builtin = usb.BUILTIN_DEFAULT
        self._submit = usb.submit_xfer
        self._ticks = time.ticks_ms
        memory = memoryview(chip.memory(_MEMORY) if chip else bytearray(_MEMORY))
        self._rx = memory[: 2 * _PLACE]
        self._places = (memory[:_PLACE], memory[_PLACE : 2 * _PLACE])
        at = 2 * _PLACE
        self._tx = memory[at : at + _OUTGOING]
        at += _OUTGOING
        packet = memory[at : at + _PACKET]
        self._packets = [packet[:n] for n in range(_PACKET + 1)]
        at += _PACKET
        self._coding = memory[at : at + 7]  # kept for the host, without meaning here
        self._coding[:] = struct.pack("<IBBB", 115200, 0, 0, 8)
        s = self._state = array("i", [0] * _WORDS)
        s[_EP_OUT] = builtin.ep_max + 1
        s[_EP_IN] = 0x80 | s[_EP_OUT]
        s[_RX] = as_word(addressof(self._rx))
        s[_TX] = as_word(addressof(self._tx))
        s[_BUS] = as_word(ADDRESS_REGISTER)
        s[_PACKET_AT] = as_word(addressof(packet))
        s[_NO_FLAG] = _UNCHANGED
        s[_FLAG] = as_word(addressof(s)) + 4 * _NO_FLAG
        s[_KEPT] = as_word(addressof(memory)) + KEPT_AT
        s[_USED] = s[_USED + 1] = _PLACE
        self._closed_at = time.ticks_ms()
        self._waits = -1  # the packet that was seen to wait
        self._waits_since = 0
        self._bus = chip.BusWatch() if chip else None
        self.open = False
        self.openings = 0

    def start(self):
        """Put the port beside the built-in one; returns at once.

        The host sees the board go, and come back with two ports. After a soft reset it sees
        nothing.
        """
        if chip:
            from framestep.hal.rp2_stack import unchecked

            port = UsbPort
            self._kinds = unchecked(
                _arm,
                _part,
                _send_packet,
                port._configured,
                port._reset,
                port._control,
                port._transferred,
            )
        usb = self._usb
        going_on = chip and chip.enabled(self._state[_EP_OUT]) and _restore(self._state, id(usb))
        if not going_on:
            usb.active(False)
        usb.builtin_driver = self._builtin
        usb.config(
            self._builtin.desc_dev,
            _descriptor(self._builtin),
            _Strings(self._builtin.str_max),
            self._configured,
            self._reset,
            self._control,
            self._transferred,
        )
        if going_on:
            self._go_on()
        else:
            _activate(self._state, usb, id(usb), bytearray(_OBJECT))

    def _go_on(self):
        """The host has the device as it was before the soft reset, and perhaps the port open: for
        it a session begins.

        A transfer that ended in between was told to nobody.
        """
        state = self._state
        time.sleep_ms(_SETTLE_MS)  # what MicroPython's USB task still has to tell
        irq = disable_irq()
        try:
            if not chip.in_flight(state[_EP_OUT], 1):
                state[_ARMED] = 0
            if not chip.in_flight(state[_EP_OUT], 0):
                state[_SENDING] = 0
        finally:
            enable_irq(irq)
        _part(state)
        if state[_SENDING]:
            chip.empty_packet(state[_EP_OUT])
        if state[_LIVE] and not state[_ARMED]:
            try:
                _arm(self)
            except OSError:  # its end comes just now
                state[_ARMED] = 1
        if state[_DTR]:
            self.open = True
            self.openings += 1

    # ------------------------------------------------------------ called by the USB driver

    @micropython.viper
    def _configured(self, descriptor):
        s = ptr32(self._state)
        s[_LIVE] = 1
        s[_ARMED] = 0
        s[_SENDING] = 0
        flag = ptr8(s[_FLAG])
        if flag[1] == 0:
            flag[0] = 0
            kept = ptr32(s[_KEPT])
            kept[_KEPT_FILL] = s[_FILL]
            kept[_KEPT_DTR] = s[_DTR]
            kept[_MARK] = ALIVE
        if (s[_FILL] - s[_TAKE]) & 3 < 2:
            _arm(self)

    @micropython.viper
    def _reset(self):
        # Bus reset or another configuration: transfers are gone. What has been seen of the running
        # one stays.
        s = ptr32(self._state)
        if s[_ARMED]:
            place = s[_FILL] & 1
            s[_END + place] = s[_SEEN]
            s[_USED + place] = _PLACE
            s[_FILL] = (s[_FILL] + 1) & 3
            s[_ARMED] = 0
        s[_LIVE] = 0
        s[_SENDING] = 0
        ptr32(s[_KEPT])[_MARK] = 0
        _part(s)
        s[_DTR] = 0
        s[_BY_DTR] = 1
        self.open = False
        self._closed_at = self._ticks()

    @micropython.viper
    def _control(self, stage: int, request):
        if stage != _STAGE_SETUP:
            return _YES
        setup = ptr8(request)
        what = setup[1]
        if setup[0] & 0x60 != 0x20:  # class requests only
            return _NO
        s = ptr32(self._state)
        dtr = setup[2] & 1
        if what == _SET_LINE_CODING or what == _SET_CONTROL_LINE_STATE:
            if what == _SET_LINE_CODING:
                dtr = s[_DTR]
            if dtr > s[_DTR]:
                _part(s)
                self.open = True
                self.openings = int(self.openings) + 1
            elif dtr < s[_DTR] or dtr == 0 and self.open:
                # Without DTR, what drivers set when a program opens or closes the port is the only
                # sign of either.
                _part(s)
                if chip:
                    chip.empty_packet(s[_EP_OUT])
                self.open = False
                self._closed_at = self._ticks()
                s[_BY_DTR] = s[_DTR]
            s[_DTR] = dtr
            ptr32(s[_KEPT])[_KEPT_DTR] = dtr
        if what == _SET_LINE_CODING or what == _GET_LINE_CODING:
            return self._coding
        if what == _SET_CONTROL_LINE_STATE:
            return _YES
        if what == _SEND_BREAK:
            return _YES
        return _NO

    @micropython.viper
    def _transferred(self, endpoint: int, result: int, count: int) -> bool:
        s = ptr32(self._state)
        if endpoint == s[_EP_OUT]:
            place = s[_FILL] & 1
            s[_END + place] = count
            s[_USED + place] = count
            s[_FILL] = (s[_FILL] + 1) & 3
            ptr32(s[_KEPT])[_KEPT_FILL] = s[_FILL]
            s[_ARMED] = 0
            if (s[_FILL] - s[_TAKE]) & 3 < 2:
                _arm(self)
        elif endpoint == s[_EP_IN]:
            if s[_LEFT] or s[_LAST] == _PACKET:
                _send_packet(self)
            else:
                s[_SENDING] = 0
        return True

    # ------------------------------------------------------------ called by the main loop

    @micropython.viper
    def poll(self, reader) -> int:
        """Offer what has arrived to `reader.feed(buffer, start, count) -> taken`; the bytes taken,
        0 if none.

        Bytes that are not taken are offered again the next time, and hold the host up once both
        places are full.
        """
        s = ptr32(self._state)
        look = (s[_LOOK] + 1) & 0xFFFFFFF
        s[_LOOK] = look
        moved = 0
        wanted = 1 if self.open else 0
        if s[_STALE]:
            _drop_stale(s)
            if not s[_ARMED] and s[_LIVE] and (s[_FILL] - s[_TAKE]) & 3 < 2:
                _arm(self)
        while True:
            place = s[_TAKE] & 1
            at = s[_AT]
            ended = s[_TAKE] != s[_FILL]
            if ended:
                end = s[_END + place]
            elif moved:
                break  # for the next look, which finds it whole, and the reader empty
            else:
                end = int(_arrived(s, look))
            if at < end:
                if wanted == 0:
                    wanted = 1 if self._heard() else -1
                taken = end - at
                if wanted > 0:
                    taken = int(reader.feed(self._rx, place * _PLACE + at, taken))
                at += taken
                s[_AT] = at
                moved += taken
            if at < end or not ended:
                break
            s[_AT] = 0
            s[_TAKE] = (s[_TAKE] + 1) & 3
            if not s[_ARMED] and s[_LIVE]:
                _arm(self)
        if wanted < 0:
            return 0
        if moved == 0 and look & 15 == 0:
            if s[_LIVE] and not s[_ARMED] and s[_TAKE] == s[_FILL]:
                # an exception ended the callback that should
                _arm(self)
            self._watch()
        return moved

    @micropython.viper
    def send(self, writer) -> int:
        """If nothing is under way, begin to send what `writer.take(buffer, limit) -> count` gives;
        else 1. Never waits.

        What is given to a closed port goes nowhere, as on any serial port.
        """
        s = ptr32(self._state)
        if self.open:
            if s[_SENDING]:
                return 1
            count = int(writer.take(self._tx, _OUTGOING))
            if count:
                s[_LEFT] = count
                s[_NEXT] = s[_TX]
                _send_packet(self)
        else:
            while int(writer.take(self._tx, _OUTGOING)):
                pass
        return 0

    # ------------------------------------------------------------ openings and closings

    def _heard(self):
        """Bytes came in through a closed port; whether they count. Those of a host that has just
        let DTR fall do not: it may have sent them before. Else there is one that does not use DTR,
        and now has the port open."""
        if self._state[_BY_DTR] and time.ticks_diff(time.ticks_ms(), self._closed_at) <= _QUIET_MS:
            return False
        self.open = True
        self.openings += 1
        return True

    def _lose(self):
        """The host has gone without a word: nothing that is under way is for the next one."""
        state = self._state
        state[_LEFT] = 0
        state[_LAST] = 0
        chip.empty_packet(state[_EP_OUT])
        self.open = False
        self._closed_at = time.ticks_ms()

    def _watch(self):
        """Close the port when the bus has died, open it again when the host wakes up and still has
        it open."""
        if chip:
            state = self._state
            if self._bus.dead():
                if self.open:
                    self._lose()
            elif (
                self.open
                and not state[_DTR]
                and state[_SENDING]
                and chip.packet_waits(state[_EP_OUT])
            ):
                now = time.ticks_ms()
                if state[_SENT] != self._waits:
                    self._waits = state[_SENT]
                    self._waits_since = now
                elif time.ticks_diff(now, self._waits_since) > _COLLECT_MS:
                    self._lose()  # its host does not use DTR
                    state[_BY_DTR] = 0
                    _part(state)
            elif not self.open and self._state[_DTR]:
                self.open = True
                self.openings += 1
