"""Session scripts: read, written and played."""

import struct

import pytest

from framestep.protocol import messages as m
from framestep_tools.client.wire import FrameDecoder, encode
from host_tests.script import Script, ScriptError, parse
from host_tests.script_player import Player

MOVE = encode(m.MSG_MOTOR_MOVE, struct.pack("<Bi", 1, 300), 5)
TEXT = f"""\
# a move, and ticks that come late
board pico
rig {{"motors": [{{"invert": true}}], "estop": "no"}}
motors 3
memory 4096
flash 1 00ff
0 open
10 rx {MOVE.hex()}
60 hold 4
70 pin estop 0
70 pin 19 1
90 skip 3
100 full
300 drain
310 close
500 end
"""


def play(text):
    edges = []
    player = Player(parse(text.splitlines()), lambda *edge: edges.append(edge))
    player.play()
    return player, edges


def frames(player):
    decoder = FrameDecoder()
    return [(ms, frame) for ms, data in player.sent for frame in decoder.feed(data)]


def test_read_and_written():
    script = parse(TEXT.splitlines())
    assert "\n".join(script.lines()) + "\n" == TEXT
    assert script.events[1] == (10, "rx", MOVE)
    assert script.events[4] == (70, "pin", (19, 1))
    assert script.end == 500
    assert script.motors == 3
    assert script.flash == {1: b"\x00\xff"}


@pytest.mark.parametrize("line", ["12 fly", "x open", "12 rx 4g", "12 pin estop", "5 open", "12"])
def test_mistakes_are_named(line):
    with pytest.raises(ScriptError, match=line):
        parse(["7 open", line])


def test_a_script_cut_short_ends_with_its_last_event():
    assert parse(["7 open", "90 close"]).end == 90


def test_a_move_is_played_and_answered():
    player, edges = play(f"0 open\n10 rx {MOVE.hex()}\n900 end")
    heard = frames(player)
    assert heard[0][1].type == m.MSG_HI
    assert [(ms, f.type) for ms, f in heard if f.id == 5] == [(10, m.MSG_MOTOR_MOVE)]
    assert (
        sum(value for _, signal, value in edges if signal == "m1") == 300 == player.board.steps(0)
    )


def test_the_main_loop_is_away():
    player, _ = play(f"0 open\n10 hold 25\n11 rx {MOVE.hex()}\n300 end")
    assert [ms for ms, f in frames(player) if f.id == 5] == [35]


def test_missed_ticks_come_late_and_are_a_fault():
    player, edges = play(f"0 open\n10 rx {MOVE.hex()}\n60 skip 3\n800 end")
    stops = [ms for ms, f in frames(player) if f.type == m.MSG_MOTOR_HARD_STOP]
    assert len(stops) == 1
    assert 63 <= stops[0] <= 67
    assert 0 < sum(value for _, signal, value in edges if signal == "m1") < 300


def test_back_pressure_keeps_what_is_to_be_sent():
    player, _ = play(f"0 open\n9 full\n10 rx {MOVE.hex()}\n200 drain\n300 end")
    sent = [ms for ms, _ in player.sent]
    assert not [ms for ms in sent if 9 <= ms < 200]
    assert 200 in sent
    assert sum(f.id == 5 for _, f in frames(player)) == 1


def test_bytes_to_a_closed_port_are_lost():
    player, _ = play(f"10 rx {MOVE.hex()}\n20 open\n300 end")
    assert [f.type for _, f in frames(player)] == [m.MSG_HI]


@pytest.mark.parametrize("rig", ['{"hard_stop', '{"hard_stop_factor": 99}', '{"no such": 1}'])
def test_a_rig_file_with_a_mistake(rig):
    """The board answers, but moves nothing."""
    player, edges = play(f"board pico\nrig {rig}\n0 open\n10 rx {MOVE.hex()}\n300 end")
    assert not [signal for _, signal, _ in edges if signal == "m1"]
    answer = next(f for _, f in frames(player) if f.id == 5)
    assert struct.unpack("<H", answer.payload)[0] == m.ERR_GENERAL
    assert "\n".join(parse([f"rig {rig}"]).lines()) == f"board host\nrig {rig}\n0 end"


def test_too_little_memory_and_no_flash():
    player, _ = play(
        'board pico\nrig {"remember_positions": true}\nmemory 16\nflash none\n0 open\n50 end'
    )
    hello = frames(player)[0][1]
    assert struct.unpack_from("<I", hello.payload, 41)[0] == 0
    assert Script().flash == {}
