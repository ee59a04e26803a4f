from hypothesis import given
from hypothesis import strategies as st

from framestep.protocol.checksum import check_bytes, fletcher16
from host_tests.protocol.test_frames import fletcher


@given(st.binary(max_size=1100), st.integers(0, 20), st.integers(0, 20))
def test_sums_of_a_part(data, before, after):
    assert fletcher16(bytearray(before) + data + bytes(after), before, len(data)) == fletcher(data)


@given(st.binary(max_size=100))
def test_check_bytes_bring_the_sums_to_zero(data):
    check = check_bytes(fletcher(data))
    assert fletcher(data + bytes((check & 0xFF, check >> 8))) == 0


def test_check_bytes_are_the_specifications_for_all_sums():
    for f0 in range(255):
        for f1 in range(255):
            c0 = 0xFF - (f0 + f1) % 0xFF
            c1 = 0xFF - (f0 + c0) % 0xFF
            assert check_bytes(f1 << 8 | f0) == c0 | c1 << 8
