"""The frozen image: positions, light levels and triggers of a long move share memory and are
played. The firmware says what does not fit."""

from itertools import pairwise

import numpy as np
import pytest

from framestep_tools import payloads as p
from framestep_tools.client.client import upload_requests
from framestep_tools.judge.judge import judge
from framestep_tools.judge.reference import Reference
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.board.test_io import DMX_PIN, Wire
from host_tests.end_to_end.session import Session, run_request

FRAMES, MOTORS, CHANNELS, FPS = 2000, 8, 32, 24
FIRST, LAST = 1970, 1984  # the scene frames played


def changes(levels):
    """Return the levels that differ from the one before."""
    return [int(new) for old, new in pairwise(levels) if new != old]


def test_two_thousand_frames_with_lights_and_triggers():
    """Eight motors, 32 channels that change at random at each frame and a trigger at each frame
    fit; they are played correctly on the wire and on the pins."""
    random = np.random.default_rng(14)
    levels = random.integers(0, 256, (CHANNELS, FRAMES))
    outputs = random.integers(0, 4, FRAMES)
    times = np.arange(FRAMES)
    moves = [np.rint(800 * np.sin(times / (20 + 3 * motor))).astype(int) for motor in range(MOTORS)]
    rig = {"outputs": [{"pin": 26}, {"pin": 27}]}
    with EmulatedBoard(rig) as board:
        session = Session(board, motors=MOTORS, reply_s=0.1)
        assert session.client.request(p.Hi()).upload_frames >= 10_000
        session.accept(p.RtUploadMoveBegin(1, FRAMES))
        for motor, steps in enumerate(moves, 1):
            session.speed(motor, 50_000, 200_000)
            for at in range(0, FRAMES, 250):
                session.accept(p.RtUploadMoveAxis(motor, at, steps[at : at + 250]))
        for channel, row in enumerate(levels, 1):
            for at in range(0, FRAMES, 1000):
                session.accept(p.RtUploadMoveDmx(channel, at, row[at : at + 1000]))
        for at in range(0, FRAMES, 100):
            pairs = [p.Trigger(i, int(outputs[i])) for i in range(at, at + 100)]
            session.accept(p.RtUploadMoveTriggers(3, pairs))
        session.accept(p.RtUploadMoveEnd())
        session.ready(run_request(FPS, FIRST, LAST, 500, 500, sync_dmx=1))
        wire = Wire(board)
        wire.emulator.trace_start([DMX_PIN, 26, 27])
        session.accept(p.RtGo()).until(p.RtEnd, 20)
        records = wire.emulator.trace_read()
    sent = [slots[1 : CHANNELS + 1] for _, _, _, slots, _ in wire.frames(records)]
    rows = [bytes(levels[:, at].tolist()) for at in range(FIRST - 1, LAST)]
    seen = [slots for i, slots in enumerate(sent) if slots in rows and slots not in sent[:i]]
    assert seen == rows, "the levels of each frame, in order"
    for bit, pin in enumerate((26, 27)):
        mine = records[records["pin"] == pin]
        wanted = [0, *(outputs[FIRST - 1 : LAST] >> bit & 1), 0]
        assert changes([0, *mine["level"]]) == changes(wanted)


@pytest.mark.repeats
def test_ten_thousand_frames_without_lights():
    """Eight motors, judged by their edges in the last second; then lights, until memory is full."""
    frames, first = 10_000, 9_975
    times = np.arange(frames)
    moves = {
        motor: np.rint(3000 * np.sin(times / (20 + 3 * motor))).astype(int)
        for motor in range(1, MOTORS + 1)
    }
    with EmulatedBoard() as board:
        session = Session(board, motors=MOTORS, reply_s=0.1)
        for motor in moves:
            session.speed(motor, 50_000, 200_000)
        session.upload(moves)
        stood = session.play(run_request(FPS, first + 1, frames, 500, 500))
        verdict = judge(
            session.trace(),
            {motor: steps[first:] for motor, steps in moves.items()},
            1000 * FPS,
            stood,
            session.positions,
            Reference(moves, 1000 * FPS, 500, 500, first, frames - 1),
        )
        assert verdict.good, verdict.complaints
        levels = np.random.default_rng(14).integers(0, 256, 1000)
        requests = list(upload_requests(1, frames, moves))
        session.client.stream(requests[:-1], 4)
        repl = board.emulator.repl()
        repl.exec("import time")
        repl.start("time.sleep_ms(500)")
        sections = [(1 + at // 10, at % 10) for at in range(100)]
        refused = next(
            (channel, index)
            for channel, index in sections
            if session.code(p.RtUploadMoveDmx(channel, 1000 * index, levels)) != p.Ack.OK
        )
        assert refused[0] >= 2
        reported = session.ask(p.GetExceeded())
        assert 0 <= reported.room < reported.by == 34 * -(-1000 // 28)
        line = f"it needs {reported.by} bytes, {reported.room} are free"
        assert repl.finish(4) == ""
        assert repl.unasked().splitlines() == [
            "framestep: the upload does not fit into memory; bytes needed and free: "
            f"{reported.by} {reported.room}"
        ]
        assert line in repl.exec("import framestep.repl; status()")
        session.accept(p.RtUploadMoveEnd())
        session.ready(run_request(FPS, first + 1, frames, 500, 500))
