"""A frame that stays incomplete: how long the device waits for its rest."""

import struct

import pytest

from framestep.controller import STALL_MS
from framestep.hal.host_board import HostBoard
from framestep_tools.client.wire import FrameDecoder, encode

pytestmark = pytest.mark.needs("inside")

HI, BEGIN, AXIS = 0x0001, 0x0100, 0x0101


def answers(board):
    return [(f.request_type, f.id) for f in FrameDecoder().feed(board.transmit()) if f.id]


def connected():
    board = HostBoard()
    board.open_port(True)
    board.run_until(20_000_000)
    board.transmit()
    return board


def test_the_rest_of_a_frame_that_never_comes():
    board = connected()
    board.receive(encode(HI, b"", 1)[:-3])
    board.run_until(board.now_ns + (STALL_MS + 20) * 1_000_000)
    board.receive(encode(HI, b"", 2))
    board.run_until(board.now_ns + 20_000_000)
    assert (HI, 2) in answers(board)


@pytest.mark.parametrize("before", [b"D", encode(HI, b"", 1)[:6]], ids=["a byte", "a frame"])
def test_its_time_counts_from_its_own_first_byte(before):
    """It does not count from an earlier byte that proves not to begin a frame."""
    board = connected()
    board.receive(before)
    board.run_until(board.now_ns + 100_000_000)
    frame = encode(HI, b"", 2)
    # so that the beginning before has an impossible length
    board.receive(b"\xff" * 4 + frame[:5])
    board.run_until(board.now_ns + (STALL_MS - 50) * 1_000_000)
    board.receive(frame[5:])
    board.run_until(board.now_ns + 20_000_000)
    assert (HI, 2) in answers(board)


def test_a_frame_whose_rest_waits_while_the_passes_are_away():
    """Several passes read its rest, the first one long after the frame began."""
    board = connected()
    board.receive(encode(BEGIN, struct.pack("<ii", 1, 100), 3))
    board.run_until(board.now_ns + 20_000_000)
    frame = encode(AXIS, struct.pack("<BI100i", 1, 0x80000000, *range(100)), 4)
    board.receive(frame[:20])
    board.run_until(board.now_ns + 5_000_000)
    controller, hal = board.controller, board.hal
    later = hal.ticks_ms() + STALL_MS + 100
    for ms in range(7):
        board.receive(frame[20 + 64 * ms : 84 + 64 * ms])
        controller.poll(later + ms)
    assert answers(board) == [(BEGIN, 3), (AXIS, 4)]
