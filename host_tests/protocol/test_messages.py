from framestep.protocol import messages
from framestep.protocol.messages import known, payload_fits

# Field notes 1.8 and 2, written down once more: the lengths up to 200 bytes that a request may have. A fixed layout may
# be longer than it is known.
LENGTHS = {
    0x0001: set(range(0, 200)),
    0x0020: set(range(3, 200)),
    0x0021: set(range(4, 200)),
    0x0022: set(range(0, 200)),
    0x0023: set(range(4, 200)),
    0x0030: set(range(0, 200)),
    0x0031: set(range(5, 200)),
    0x0032: set(range(1, 200)),
    0x0033: set(range(0, 200)),
    0x0034: set(range(0, 200)),
    0x0035: set(range(5, 200)),
    0x0036: set(range(7, 200)),
    0x0037: set(range(2, 200)),
    0x0038: set(range(9, 200)),
    0x0039: set(range(12, 200)),
    0x0100: set(range(8, 200)),
    0x0101: set(range(5, 200, 4)),
    0x0102: set(range(6, 200)),
    0x0103: set(range(0, 200)),
    0x0104: set(range(4, 200, 8)),
    0x0110: set(range(4, 200)),
    0x0111: set(range(29, 200)),
    0x0112: set(range(11, 200, 9)),
    0x0113: set(range(0, 200)),
    0x0115: set(range(12, 200, 9)),
    0x0116: set(range(0, 200)),
    0x0120: set(range(8, 200)),
    0x0200: set(range(1, 200)),
    0x0201: set(range(5, 200)),
    0x0202: set(range(1, 200)),
    0x0203: set(range(7, 200)),
    0x0205: set(range(0, 200)),
    0x0206: set(range(3, 200)),
    0x0207: set(range(13, 200)),
    0x4600: set(range(0, 200)),  # framestep's own
    0x4601: set(range(0, 200)),
}


def test_payload_lengths_of_every_type():
    for kind in [*range(0x0400), *range(0x4500, 0x4800), 0x8001, 0xFFFF]:
        assert known(kind) == (kind in LENGTHS)
        assert {n for n in range(200) if payload_fits(kind, n)} == LENGTHS.get(kind, set()), hex(kind)


def test_every_request_type_has_a_name():
    names = {value for name, value in vars(messages).items() if name.startswith("MSG_")}
    sent_only = {messages.MSG_MOTOR_HARD_STOP, messages.MSG_RT_END, messages.MSG_FLAG_ACK}
    assert names - sent_only == set(LENGTHS)


def test_no_two_names_of_a_kind_share_a_number():
    for prefix in "MSG_", "ERR_", "CAP_", "MOTOR_", "RUN_", "VIRT_MOTOR_", "HARD_STOP_", "LINE_":
        values = [value for name, value in vars(messages).items() if name.startswith(prefix)]
        assert len(values) == len(set(values)) > 1
