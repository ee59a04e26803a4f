"""Transfers of the protocol's USB port, packet by packet, also across a soft reset.

In. A transfer from the host takes up to 17 packets of 64 bytes, so the largest frame takes one
callback instead of seventeen. It ends early with a packet that is not full. A frame whose length is
a multiple of 64 bytes has no such packet, and would wait in an unfinished transfer until more
comes. So each packet's place in memory holds a mark while the transfer runs. The USB driver copies
a whole packet to its place in its interrupt, so if the mark is gone, a packet has arrived. In this
way the main loop takes packets from an unfinished transfer, and nothing is held up. Two slots
alternate: the callback that ends a transfer begins the next one as soon as the main loop has
emptied its slot.

Out. Packets go one at a time, from one callback to the next. The last packet is never full (it is
empty if need be), because hosts wait for such a packet before they pass on what they have received.

Between the interrupt of a bus reset and TinyUSB's task, which reports it, TinyUSB has forgotten all
endpoints. A transfer submitted to one then ends in panic(), and the processor stops for good. That
interrupt clears the device's address. So the address is checked before each transfer, with
interrupts off from the check to the end of the call.

A soft reset, as mpremote makes one before each of its commands, must not disconnect the device:
mpremote's own port would disappear. MicroPython disconnects a USBDevice that is active then, but
not an inactive one. So MicroPython's flag for "active" is set only during calls. After the soft
reset the host's transfers go on, into memory that does not belong to the heap (hal.rp2.usb.memory).
The next port takes over this memory: slots and state words have fixed addresses.

Until the next port starts, changes of DTR go unnoticed. So a port that was open is tested: it gets
an empty packet, which a host that still has it open collects. If DTR is set then, even if it was
set before, the port counts as opened.
"""

import sys
from array import array

from framestep.base.native import addressof, const, micropython, ptr8, ptr32
from framestep.hal import QUESTION

try:
    from machine import USBDevice  # noqa: F401 -- the port needs it
except ImportError:
    raise ImportError(
        "a serial port of its own for the protocol needs machine.USBDevice, "
        "which this board's MicroPython does not have; "
        'set "ports": 1 in rig.json, '
        "or use MicroPython 1.23 or newer on an RP2040, RP2350 or ESP32-S3"
    )

if sys.platform == "rp2":
    from machine import disable_irq, enable_irq

    from framestep.hal.rp2 import usb as chip
    from framestep.hal.rp2.usb import ADDRESS_REGISTER
else:
    # Here a pulled cable goes unnoticed, and a new client may get a packet meant for the last one.
    chip = None
    _one = array("i", [1])
    ADDRESS_REGISTER = addressof(_one)

    # TinyUSB takes a mutex of FreeRTOS for each transfer, so interrupts have to stay on.
    def disable_irq():
        return 0

    def enable_irq(_state):
        pass


_STOP = const(0x32)  # protocol.messages
_STOP_ALL = const(0x33)
_GO = const(0x113)

# Bits of ADDRESS_REGISTER: 0 from a bus reset until the host has given a new address
_ADDRESS = const(0x7F)
PACKET = const(64)  # full-speed bulk endpoint
PLACE = const(1088)  # bytes of a slot, 17 packets: room for the largest frame, 1048 bytes
OUTGOING = const(256)  # bytes taken from the writer at a time

# The mark: words 0 and 15 of a packet's place. Only a full packet overwrites its last byte.
MARK_0 = const(0x1B7E35C9)
_MARK_15 = const(0x2B951CE7)
_MARK_LAST = const(0x2B)

# As objects, because a viper function cannot make its own True and False
YES = True
NO = False

# State words
EP_OUT = const(0)
EP_IN = const(1)
LIVE = const(2)  # configured by a host
ARMED = const(3)  # a transfer from the host is under way
FILL = const(4)  # transfers ended, modulo 4; the next or running one has slot FILL & 1
TAKE = const(5)  # transfers emptied, modulo 4
END = const(6)  # of each slot: bytes in it, once its transfer has ended
USED = const(8)  # of each slot: bytes from its start that may not hold the mark
SEEN = const(10)  # bytes of the running transfer known to have arrived, whole packets
AT = const(11)  # bytes taken from the slot that is being emptied
DOUBT = const(12)  # number of the check at which the packet at SEEN seemed to be short
LOOK = const(13)  # number of the present check, from 1 on
RX = const(14)  # address of the two slots
SENDING = const(15)
LEFT = const(16)  # bytes of the outgoing buffer still to be sent
NEXT = const(17)  # address of the next one
PACKET_AT = const(18)  # address of the packet's buffer
LAST = const(19)  # length of the present packet
TX = const(20)  # address of the outgoing buffer
DTR = const(21)
STALE = const(22)  # 1: drop bytes that had arrived when a session began or ended
STALE_FILL = const(23)  # FILL at that moment
STALE_AT = const(24)  # bytes of the running transfer that had arrived by then
BY_DTR = const(25)  # the port was last closed by DTR
BUS = const(27)  # address of the word with the device's address
SENT = const(26)  # packets, modulo 2^28
# address of MicroPython's flag for an active device, and of the next one: a change is due
FLAG = const(28)
KEPT = const(29)  # address of the words that survive a soft reset
NO_FLAG = const(30)  # used in place of the flags if they have not been found
# DTR dates from before a soft reset, and may have been cleared unnoticed. 2: it is not known yet
# whether a host collects packets; 1: it does
UNHEARD = const(31)
VIEW = const(32)  # address of the memoryview of the packet's buffer
HELD = const(33)  # 1: bytes could not be sent, because a packet had not gone yet
# bytes of the running transfer that had arrived at the last look, if it begins with a section
LEAVE = const(34)
WAITS = const(35)  # number of the packet that waited at the last look
INSIDE = const(36)  # 1: callbacks come within a pass, from glance()
WORDS = const(37)

_LENGTH = const(2)  # word of a memoryview (py/objarray.h, MicroPython 1.20 to 1.28)

# Words that survive a soft reset
KEPT_MARK = const(0)  # ALIVE: the device is live, and stays so across a soft reset
KEPT_FILL = const(1)
KEPT_DTR = const(2)
KEPT_FLAG = const(3)  # distance of the flag from the beginning of MicroPython's object

ALIVE = const(0x1D7A5C3B)  # also used by framestep.soft_reset
OBJECT = const(256)  # bytes of MicroPython's object that are searched
UNCHANGED = const(0x101)  # both flags set: changes of the first have no effect
# in the memory for USB: two slots, outgoing bytes, a packet, line coding
KEPT_AT = const(2 * 1088 + 256 + 64 + 8)
MEMORY = const(KEPT_AT + 16)


@micropython.viper
def arm(port):
    """Let the host send into the next slot. Restores the marks where packets have been."""
    s = ptr32(port._state)
    place = s[FILL] & 1
    at = s[RX] + place * PLACE
    end = at + s[USED + place]
    while at < end:
        mark = ptr32(at)
        mark[0] = MARK_0
        mark[15] = _MARK_15
        at += PACKET
    s[END + place] = 0
    s[SEEN] = 0
    s[LEAVE] = 0
    s[DOUBT] = 0
    flag = ptr8(s[FLAG])
    submit = port._submit
    memory = port._places[place]
    irq = disable_irq()
    was = flag[0]
    flag[0] = 1
    try:
        if ptr32(s[BUS])[0] & _ADDRESS and submit(s[EP_OUT], memory):
            s[ARMED] = 1
    finally:
        flag[0] = was
        enable_irq(irq)


@micropython.viper
def arrived(s: ptr32, look: int) -> int:
    """Return how many bytes of the running transfer have arrived, in whole packets.

    look: number of this check, from 1 on.
    """
    end = s[SEEN]
    while s[ARMED] and end < PLACE:
        packet = ptr32(s[RX] + (s[FILL] & 1) * PLACE + end)
        if packet[15] >> 24 == _MARK_LAST:
            if packet[15] == _MARK_15 and packet[0] == MARK_0:
                break
            # It is a short packet, so the callback with its length is due; or a full one whose last
            # byte equals the mark's. If there is no callback by the next check, it was full.
            if s[DOUBT] == 0 or s[DOUBT] == look:
                s[DOUBT] = look
                break
        s[DOUBT] = 0
        end += PACKET
        s[SEEN] = end
    return end


@micropython.viper
def mark_stale(s: ptr32):
    """Mark what has arrived as stale, and drop what is being sent: a session begins or ends.

    In the running transfer, every packet whose place no longer holds the mark is stale. The host
    learns that the port is open only after this has returned, so it has sent nothing of the new
    session yet.
    """
    end = s[SEEN]
    if s[ARMED] == 0:
        end = 0
    while s[ARMED] and end < PLACE:
        packet = ptr32(s[RX] + (s[FILL] & 1) * PLACE + end)
        if packet[15] == _MARK_15 and packet[0] == MARK_0:
            break
        end += PACKET
    s[STALE] = 1
    s[STALE_FILL] = s[FILL]
    s[STALE_AT] = end
    s[LEFT] = 0
    s[LAST] = 0


@micropython.viper
def forget_host(s: ptr32):
    """Note that the host has gone without clearing DTR, which is meaningless from now on."""
    s[DTR] = 0
    s[UNHEARD] = 0
    s[BY_DTR] = 0
    ptr32(s[KEPT])[KEPT_DTR] = 0


@micropython.viper
def drop_stale(s: ptr32):
    """Drop what mark_stale() has marked."""
    s[STALE] = 0
    while s[TAKE] != s[STALE_FILL]:
        s[TAKE] = (s[TAKE] + 1) & 3
        s[AT] = 0
    if s[AT] < s[STALE_AT]:
        s[AT] = s[STALE_AT]
    if s[SEEN] < s[AT] and s[TAKE] == s[FILL]:
        s[SEEN] = s[AT]
        s[DOUBT] = 0


@micropython.viper
def send_packet(port):
    """Send the next packet: 64 bytes, the rest, or an empty packet."""
    s = ptr32(port._state)
    if not s[LIVE]:
        s[SENDING] = 0
        return
    count = s[LEFT]
    if count > PACKET:
        count = PACKET
    to = ptr32(s[PACKET_AT])
    source = ptr32(s[NEXT])
    i = 0
    while i << 2 < count:
        to[i + 0] = source[i + 0]
        i += 1
    s[NEXT] += count
    s[LEFT] -= count
    s[LAST] = count
    s[SENDING] = 1
    s[SENT] = (s[SENT] + 1) & 0xFFFFFFF
    ptr32(s[VIEW])[_LENGTH] = count  # instead of one memoryview for each length
    flag = ptr8(s[FLAG])
    submit = port._submit
    packet = port._packet
    irq = disable_irq()
    was = flag[0]
    flag[0] = 1
    try:
        if ptr32(s[BUS])[0] & _ADDRESS:
            submit(s[EP_IN], packet)
    finally:
        flag[0] = was
        enable_irq(irq)


@micropython.viper
def activate(s: ptr32, usb, at: int, before):
    """Switch the device on, and find MicroPython's flags: the bytes of its object that change.

    at: address of the object. before: OBJECT bytes of scratch.
    """
    flag = ptr8(at)
    kept = ptr8(before)
    i = 0
    while i < OBJECT:
        kept[i] = flag[i]
        i += 1
    usb.active(YES)
    i = 0
    while i < OBJECT and flag[i] == kept[i]:
        i += 1
    if i < OBJECT and flag[i] == 1 and flag[i + 1] == 1 and kept[i + 1] == 0:
        flag[i] = 0
        off = usb.active()
        flag[i] = 1
        if not off:
            s[FLAG] = at + i
            ptr32(s[KEPT])[KEPT_FLAG] = i


@micropython.viper
def restore(s: ptr32, at: int) -> int:
    """Restore the state kept across a soft reset. Return 0 if there is none.

    at: address of MicroPython's object.
    """
    kept = ptr32(s[KEPT])
    if kept[KEPT_MARK] != ALIVE or not ptr32(s[BUS])[0] & _ADDRESS:
        return 0
    s[FLAG] = at + kept[KEPT_FLAG]
    s[FILL] = kept[KEPT_FILL]
    s[TAKE] = s[FILL]
    s[DTR] = kept[KEPT_DTR]
    s[UNHEARD] = 2 * s[DTR]
    s[BY_DTR] = 1
    s[LIVE] = 1
    s[ARMED] = 1
    s[SENDING] = 1
    return 1


@micropython.viper
def look(port, stops: int):
    """Begin what has come in by the running transfer, though it has not ended: one packet at least.
    stops: stops only."""
    s = ptr32(port._state)
    first = (s[FILL] & 1) * PLACE
    if s[STALE] or not port.answer or not port.open:
        return
    at = first
    while at < first + PLACE - PACKET and ptr32(s[RX] + at + PACKET)[0] != MARK_0:
        at += PACKET
    count = int(chip.arrived(s[EP_OUT]))
    end = at + count
    if count < 0:  # the last one was full
        end = at + PACKET
    taken = first
    if s[TAKE] == s[FILL]:
        taken += s[AT]
        frame = ptr8(s[RX] + taken)
        if stops == 0 and end - taken == QUESTION + frame[8]:
            if frame[7] == 0 or frame[6] | (frame[7] << 8) == _GO:
                reply(port, taken)
                return
    begin_stops(port, first, taken, end)


@micropython.viper
def begin_stops(port, at: int, taken: int, end: int):
    """Begin each stop in the slots up to offset `end`, whatever comes before it; a STOP_ALL first,
    since no other stop matters then.

    at: where the first frame begins. Those that end before `taken` may have been carried out.
    """
    s = ptr32(port._state)
    kind = _STOP_ALL
    while kind >= _STOP:
        i = at
        while end - i >= QUESTION:
            frame = ptr8(s[RX] + i)
            size = QUESTION + frame[8] + (frame[9] << 8)
            if frame[0] != 0x44 or frame[1] != 0x46 or end - i < size:
                break
            if frame[7] == 0 and frame[6] == kind and i + size > taken:
                port.answer(port._rx, i, port._tx)
                if kind == _STOP_ALL:
                    return
            i += size
        kind -= 1


@micropython.viper
def reply(port, at: int) -> int:
    """Answer the question, or store the section, at this offset in the slots; 0: a pass does."""
    count = int(port.answer(port._rx, at, port._tx))
    if count:
        s = ptr32(port._state)
        frame = ptr8(s[RX] + at)
        s[AT] = s[AT] + QUESTION + frame[8] + (frame[9] << 8)
        s[LEFT] = count
        s[NEXT] = s[TX]
        if s[SENDING] == 0:
            send_packet(port)
    return count
