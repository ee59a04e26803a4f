"""What the tests of real-time operations share: an upload with lights and triggers, and what its
edges must be."""

import numpy as np

from framestep_tools import payloads as p
from framestep_tools.judge.judge import frame_times_ns, judge
from framestep_tools.judge.trace import Trace
from host_tests.end_to_end.session import simulated

FRAMES = 25
PING_PONG, LOOP, VIDEO, STILLS = 0x01, 0x02, 0x10, 0x20
VELOCITY, ACCELERATION = 20_000, 100_000
# A motor at constant speed and one that swings; scene frames 1 to 25
MOVE = {
    1: 100 + 60 * np.arange(FRAMES),
    2: np.round(400 * np.sin(np.arange(FRAMES) * 0.3)).astype(int),
}
LEVELS = {17: (np.arange(FRAMES) * 7 % 256).astype(int), 300: np.repeat([200, 0, 90, 90, 250], 5)}
MASK = 0b0111
# bit 3 is not in the mask
TRIGGERS = {0: 0b001, 3: 0b010, 4: 0b010, 5: 0b110, 11: 0b1001, 24: 0b100}
ALL_OFF = ("shutter", "meter", "gio1", "gio2", "gio3", "gio4")
RIG = {"outputs": [{"pin": pin} for pin in (22, 26, 27, 28)], "inputs": []}


def rig(**settings):
    """Return a session whose motors are fast enough for MOVE, with four outputs."""
    session = simulated({**RIG, **settings})
    for motor in MOVE:
        session.speed(motor, VELOCITY, ACCELERATION)
        session.accept(p.MotorConfigure(motor, 0x03))
    return session


def upload(session, positions=None, levels=None, triggers=None, mask=MASK, start=1, frames=FRAMES):
    """Upload positions, and their lights and triggers."""
    session.accept(p.RtUploadMoveBegin(start, start + frames - 1))
    for motor, steps in (MOVE if positions is None else positions).items():
        for at in range(0, len(steps), 250):
            last = p.LAST_SECTION if at + 250 >= len(steps) else 0
            session.accept(p.RtUploadMoveAxis(motor, at | last, steps[at : at + 250]))
    for channel, row in (levels or {}).items():
        session.accept(p.RtUploadMoveDmx(channel, p.LAST_SECTION, row))
    if triggers is not None:
        session.accept(
            p.RtUploadMoveTriggers(mask, tuple(p.Trigger(i, on) for i, on in triggers.items()))
        )
    session.accept(p.RtUploadMoveEnd())


def loaded(**settings):
    """Return a session with everything uploaded."""
    session = rig(**settings)
    upload(session, levels=LEVELS, triggers=TRIGGERS)
    return session


def edges(session, signal):
    """Return [(seconds, level)] of a signal so far."""
    times, values = session.trace().signals.get(signal, (np.zeros(0), np.zeros(0, int)))
    return [(float(t) * 1e-9, int(v)) for t, v in zip(times, values, strict=True)]


def changes(session, signal):
    """Return the same without levels of no duration, which two cues of a tick may leave."""
    found = []
    for time, level in edges(session, signal):
        if found and found[-1][0] == time:
            found.pop()
        if not found or found[-1][1] != level:
            found.append((time, level))
    return found


class Levels:
    """The level of one signal over time: levels(time)."""

    def __init__(self, session, signal):
        times, self._values = session.trace().signals.get(signal, (np.zeros(0), np.zeros(0, int)))
        self._times = times * 1e-9

    def __call__(self, time):
        at = np.searchsorted(self._times, time, side="right")
        return int(self._values[at - 1]) if at else 0


def level_now(session, signal):
    """Return the present level of a signal."""
    return Levels(session, signal)(session.now)


def laps_seen(session):
    """Return [[(time, scene frame), …], …]: the frames in position reports, a list for each lap.

    The frame on which a lap begins is missing: the reports have its MOVE TIME before the motors
    reach it.
    """
    reported, before = [], None
    for time, message in session.events(p.Positions):
        frame = message.move_time / 1000
        if before is None or frame == before:
            before = frame
            continue
        step = frame - before
        before = frame
        if abs(step) == 1:
            if (
                not reported
                or reported[-1][-1][1] != frame - step
                or (len(reported[-1]) > 1 and reported[-1][-2][1] == frame)
            ):
                reported.append([])
            reported[-1].append((time, frame))
    return reported


def pass_trace(session, begin, end, start):
    """Return a trace of the edges between two times (s), and where the motors are at its
    begin."""
    trace = session.trace()
    cut, places = {}, {}
    for name, (times, values) in trace.signals.items():
        inside = (times >= begin * 1e9) & (times < end * 1e9)
        cut[name] = (times[inside], values[inside])
    for motor, place in start.items():
        times, signs = trace.steps(motor)
        places[motor] = int(place + signs[times < begin * 1e9].sum())
    return Trace(cut), places


def judge_lap(session, begin, end, start, positions, fps, **more):
    """Return the verdict on one lap of a loop, which has the time of its first frame."""
    trace, places = pass_trace(session, begin, end, start)
    verdict = judge(trace, positions, round(fps * 1000), places, **more)
    assert verdict.good, verdict.complaints
    return verdict


def frame_times(verdict, fps, frames=FRAMES):
    """Return when each frame was, seconds."""
    return (verdict.origin_ns + frame_times_ns(frames, round(fps * 1000))) * 1e-9


def turning(first, last):
    """Return the indices of the frames from one to another in the order of play."""
    step = 1 if last >= first else -1
    return np.arange(first, last + step, step)


def go(session, request):
    """Prepare a run, forget events, start. Return where the motors waited."""
    session.ready(request)
    before = session.positions
    session.forget()
    session.accept(p.RtGo())
    return before


def to_the_end(session, seconds=20):
    """Wait for RT_END, which must be the only one. Return when it came."""
    session.client.wait_event(p.RtEnd, seconds)
    ended = session.now
    session.run(0.5)
    session.wait_idle()  # on the end frame again (field note 6.11)
    assert not session.events(p.RtEnd), "RT_END came twice"
    return ended


def judged(session, before, fps=24, first=1, last=FRAMES, roll=0.5):
    """Return a verdict for each lap, each over all its frames."""
    verdicts = []
    for reported in laps_seen(session):
        backward = reported[-1][1] < reported[0][1]
        frames = turning(last, first) if backward == (last > first) else turning(first, last)
        assert [f for _, f in reported] == frames[1:].tolist()
        positions = {m: steps[frames - 1] for m, steps in MOVE.items()}
        begin = reported[0][0] - 1 / fps - roll / 2
        verdicts.append(
            judge_lap(session, begin, reported[-1][0] + roll / 2, before, positions, fps)
        )
    return verdicts


def assert_held(session, signal, row, times):
    """Assert that a signal has each frame's level from 1 ms after the frame's time until 1 ms
    before the next one's."""
    level = Levels(session, signal)
    ends = np.append(times[1:], times[-1] + np.diff(times).min())
    for i, (time, end) in enumerate(zip(times, ends, strict=True)):
        assert level(time + 0.001) == row[i] == level(end - 0.001), (signal, i)


def assert_levels(session, times, frames):
    for channel, row in LEVELS.items():
        assert_held(session, f"dmx{channel}", row[list(frames)], times)


def assert_triggers(session, times, frames):
    for bit in range(3):
        assert_held(
            session, f"gio{bit + 1}", [TRIGGERS.get(frame, 0) >> bit & 1 for frame in frames], times
        )


def camera(session):
    """Return [(begin, end)] of the shutter's openings; the meter is on for the same times."""
    shutter = changes(session, "shutter")
    assert shutter == changes(session, "meter")
    assert [v for _, v in shutter] == [1, 0] * (len(shutter) // 2)
    return [(a, b) for (a, _), (b, _) in zip(shutter[::2], shutter[1::2], strict=True)]
