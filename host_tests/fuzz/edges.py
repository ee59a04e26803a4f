"""The judge of the edges on the pins: they keep within what a motor may do."""

import numpy as np

from framestep.hal.host import CYCLES as MS
from framestep.protocol import messages as m
from framestep_tools.judge.motion_limits import (
    ACCELERATION,
    JERK,
    SESSION,
    VELOCITY,
    VIRTUAL_SESSION,
    beyond,
    too_close,
)

from .bounds import STEEPEST, play
from .findings import Part

# A jerk shorter than four ticks is left out (ramps.py): the acceleration then jumps by four times
# the jerk, which twists by 3 w² more; twice at a ramp's top.
_JERK_MS, _LEAST_JERK_MS = 3, 8
_WIDEST = 512  # ms
_KINDS = {
    VELOCITY: ("velocity", "moves"),
    ACCELERATION: ("acceleration", "bends"),
    JERK: ("jerk", "twists"),
}


class Edges(Part):
    """The judge of edges."""

    def judge(self, motor):
        """Compare a motor's edges so far with its limits, then start from their end."""
        name = f"motor {motor.index + 1}"
        edges = motor.edges
        quiets, motor.quiets = motor.quiets, []
        if motor.quiet is not None:
            quiets.append((motor.quiet, self.ms + 10))
        if not edges:
            return
        e = np.array(edges)
        cycles = e >> 1
        signs = np.where(e & 1, 1, -1)
        self.counts["edges"] += len(e)
        self.looks.add("limits")
        if quiets:
            self.looks.add("quiet")
        for since, until in quiets:
            rests = since + 1
            late = cycles[(cycles > rests * MS) & (cycles < until * MS)]
            if len(late):
                self.fail(
                    "quiet",
                    f"{name} makes a step at {late[0] / MS:.2f} ms, but rests since {rests:.2f} ms",
                )
        places = motor.at + np.cumsum(signs)
        self._where(motor, name, places, cycles)
        first = int(cycles[0]) // MS + (-1 if motor.fresh else 1)
        motor.fresh = False
        # the limits after that are not all known while it moves
        grid = np.arange(first, max(min(int(cycles[-1]) // MS + 3, self.ms), first + 1)) * MS
        place = np.concatenate(([motor.at], places))[np.searchsorted(cycles, grid, side="right")]
        self._keeps_limits(motor, name, place, grid // MS)
        fastest = motor.top[-1][1]
        if fastest < 100_000:
            # a ramp of a tick or two is only as fine as ticks are
            brief = fastest < 0.004 * min(motor.steep[-1][1], STEEPEST)
            if self.trial.virtual:
                # within 16 ms its path may get a step ahead of its line (field note 9.5)
                fastest = max(fastest, fastest / 2 + 1.5 / 0.016)
            # Where a ramp ends within a tick, steps are up to 0.2 % of their distance too early.
            # With a step in a tick or fewer: by an eighth of what the ramp changes in a tick.
            early = 0.003 + (min(motor.steep[-1][1], STEEPEST) / 8e6 if fastest < 2000 else 0)
            least = 1 / fastest * (0.5 if brief else max(0.5, 1 - early)) - SESSION.early_s
            times = cycles * (1e-3 / MS)
            if (at := too_close(times, least, signs)) is not None:
                self.fail(
                    "velocity",
                    f"{name} makes two steps {1e6 * (times[at + 1] - times[at]):.1f} µs apart at "
                    f"{1e3 * times[at + 1]:.2f} ms, allowed {motor.top[-1][1]:.0f}/s",
                )
        motor.load = int(
            play(np.concatenate(([motor.at], places)), motor.load - motor.at, motor.backlash)[-1]
        )
        motor.at = int(places[-1])
        edges.clear()
        motor.seen = motor.made = 0

    def _range(self, motor):
        """Return the motor's range since its last rest; a host that does not read does not see
        that a request is carried out."""
        places = [motor.low, motor.high]
        for request in self.trial.open.values() if self.trial.player.full else ():
            if request.kind in (m.MSG_MOTOR_MOVE, m.MSG_MOTOR_JOG) and request.motor == motor.index:
                places.append(int.from_bytes(request.payload[-4:], "little", signed=True))
        return min(places), max(places)

    def _where(self, motor, name, places, cycles):
        low, high = int(places.min()), int(places.max())
        times = cycles // (16 * MS)
        fast = 62.5 * float(np.unique(times, return_counts=True)[1].max())
        # a stop's deceleration is rounded down to a multiple of 0.24 steps/s²
        slack = 1 + int(fast * fast / 2 / motor.least / (4 * motor.least))
        if motor.loose:
            slack += int(fast / 1000) + 1  # a queue that has run dry is noticed a tick later
        if motor.jerk and motor.sent > 1:
            # without a soft limit nearby a plan may need more room than the one before it
            slack += int(
                fast * fast / motor.least
                + 4 * fast * min((fast / motor.jerk) ** 0.5, motor.steep[-1][1] / motor.jerk)
            )
        if not motor.free:
            least, most = self._range(motor)
            outside = (places < least - slack) | (places > most + slack)
            if outside.any():
                at = cycles[outside][0] / MS
                out = places[outside][0]
                self.fail("astray", f"{name} is at {out}, at {at:.1f} ms outside {least} … {most}")
        if motor.soft is not None:
            if motor.soft != (None, None):
                self.looks.add("soft limits")
            lower, upper = motor.soft
            if (lower is not None and low < lower) or (upper is not None and high > upper):
                self.fail(
                    "limits",
                    f"{name} goes to {low} … {high}, its soft limits are {lower} … {upper}",
                )

    @staticmethod
    def _bound(changes, ms):
        times = np.array([t for t, _ in changes])
        values = np.array([v for _, v in changes], float)
        return values[np.maximum(np.searchsorted(times, ms, side="right") - 1, 0)]

    def _keeps_limits(self, motor, name, place, ms):
        """Compare differences of the places at each millisecond with velocity, acceleration and
        jerk."""
        within = VIRTUAL_SESSION if self.trial.virtual else SESSION
        top = self._bound(motor.top, ms)
        steep = self._bound(motor.steep, ms)
        for order, w in _spans(len(place), jerk=motor.jerk and not motor.jerky):
            if order == VELOCITY:
                limit = top[w:]
            elif order == ACCELERATION:
                limit = steep[2 * w :]
            else:
                self.looks.add("jerk")
                limit = motor.jerk * max(w + _JERK_MS, _LEAST_JERK_MS) / w
            if found := beyond(place, order, w, within.most(order, limit, w * 1e-3)):
                at, steps, allowed = found
                kind, does = _KINDS[order]
                self.fail(
                    kind,
                    f"{name} {does} by {steps} steps in {order} x {w} ms from {ms[at]} ms on, "
                    f"{allowed:.1f} are allowed",
                )

    def together(self, motor, partner):
        """Compare coupled motors, at every millisecond and at rest."""
        if motor.edges or partner.edges:
            self.looks.add("couples")
            both = []
            for each, sign in ((motor, motor.coupled), (partner, 1)):
                e = np.array(each.edges or [0])
                signs = np.where(e & 1, sign, -sign) if each.edges else np.array([0])
                both.append((e >> 1, np.concatenate(([0], np.cumsum(signs)))))
            last = max(int(times[-1]) for times, _ in both) // MS + 2
            grid = np.arange(last - 5000 if last > 5000 else 0, last) * MS
            a, b = (places[np.searchsorted(times, grid, side="right")] for times, places in both)
            apart = np.abs(a - b - (a[0] - b[0]))
            ends = int(both[0][1][-1] - both[1][1][-1])
            if apart.max() > 1 or ends:
                i = int(np.argmax(apart > 1))
                self.fail(
                    "coupled",
                    f"motors {motor.index + 1} and {partner.index + 1} are "
                    f"{apart.max()} steps apart from {grid[i] // MS} ms on, {ends} at rest",
                )


def _spans(count, jerk):
    """Yield (order of the difference, its span in ms): powers of 2 that fit into `count` ms."""
    for order in (VELOCITY, ACCELERATION, JERK)[: 3 if jerk else 2]:
        w = 1 if order == VELOCITY else 2
        while order * w < count and w <= _WIDEST:
            yield order, w
            w *= 2
