"""Plans of runs: whether the motors can do what is asked, and where they wait.

The run itself is in run.py. A lap begins with each motor's pre-roll, from rest to its velocity at
the first frame, and ends with its post-roll (field note 6.2).
"""

from array import array

from framestep.base.native import const
from framestep.base.results import (
    ERR_POSTROLL,
    ERR_PREROLL,
    EXCEEDED_POSTROLL,
    EXCEEDED_PREROLL,
    OK,
)
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.motors.backlash import BACKLASH
from framestep.motors.rates import MAX_ACCELERATION
from framestep.moves.frame_clock import MICROSECONDS
from framestep.moves.path import registers
from framestep.moves.path.registers import FRAME_SPEED, FRAME_TICKS, ROLL_TICKS, SPEEDS

LONGEST_ROLL = const(600000)  # ms
DEFAULT_OPEN = const(90)  # degrees, for stills whose request has no angles (field note 6.9)
DEFAULT_CLOSE = const(180)

# From microseconds
_FRAME_TICKS = formula(
    registers,
    """
    LONGER_FRAME_TICKS = (FRAME_TICKS + 1) / THOUSAND
    FRAME_TICKS = FRAME_TICKS / THOUSAND
    """,
)
# The shortest ramp between rest and a velocity, with at most that acceleration. Motors rest on
# whole steps, so its way is a whole number of them: the next one, or, if they are many, one that is
# `more` further; on less than half a step they stay where they are. It takes at least 2 ms, since
# the next phase must not begin in the ramp's first tick.
_SHORTEST_RAMP = formula(
    registers,
    "velocity, acceleration, more",
    """
    speed = max(velocity, -velocity)
    assert speed > ZERO
    way = speed * speed / acceleration / 2
    room = min(max(way - 16, 0), more)
    steps = -floor(-way - room)
    steps = min(steps, floor(2 * way) * 2 ** 20)
    ROLL_TICKS = max(max(2 * steps, way + way) / speed, 2)
    """,
)


class Plan:
    """A request, and the values computed for it.

    There are two plans, so that a refusal changes nothing.
    """

    def __init__(self, motors):
        self.bits = 0
        self.first = 0  # index of the first frame played
        self.step = 1  # 1 forward, -1 backward
        self.frames = 0  # frames after the first
        self.fps_milli = 0
        self.pre_asked = 0  # ms, 0: the shortest possible
        self.post_asked = 0
        self.pre_ms = 0  # from the start to the first frame
        self.post_ms = 0  # from the end of the last frame to the end
        self.pre_rolls = array("i", [0] * (2 * motors))  # reals, for each motor: ticks of its ramp
        self.post_rolls = array("i", [0] * (2 * motors))
        self.loops = False  # until STOP_LOOP each lap begins at the start again
        self.turns = False  # until STOP_LOOP each lap runs the other way (ping-pong)
        self.video = False  # a video camera runs during the lap
        self.stills = False  # the shutter opens at each frame
        self.open_angle = 0
        self.close_angle = 0
        self.sync = False
        self.bloop_bits = 0
        self.bloop_channel = 0
        self.bloop_ms = 0
        # For each motor. A direction is 1 for up, -1 for down, 0 if it does not move.
        self.begins = array("i", [0] * motors)  # where it waits
        self.begin_directions = array("i", [0] * motors)  # in which it starts from there
        self.ends = array("i", [0] * motors)  # where it rests after any lap but the last
        self.end_directions = array("i", [0] * motors)  # in which it starts to play backward


class RunPlanner:
    """Computes plans: whether the motors can do them, and where they wait and come to rest."""

    def __init__(self, player, move_check):
        self.player = player
        self.move_check = move_check
        self.store = player.store
        # for each motor, in the last lap: position at the end of the end frame, and where it comes
        # to rest
        self.lasts = array("i", [0] * player.count)
        self.rests = array("i", [0] * player.count)

    def settle(self, plan):
        """Check a plan, and find where the motors begin and end. Return a code."""
        player = self.player
        fps_milli = plan.fps_milli
        player.set_frame_rate(fps_milli)
        self.set_durations(fps_milli)
        last = plan.first + plan.step * plan.frames
        self._find_directions(plan, plan.begin_directions, plan.first, plan.step)
        self._find_directions(plan, plan.end_directions, last, -plan.step)
        code = self.move_check.check(
            plan.bits, plan.first, plan.frames + 1, fps_milli, plan.step, plan.begin_directions
        )
        if code == OK and plan.turns:
            code = self.move_check.check(
                plan.bits, last, plan.frames + 1, fps_milli, -plan.step, plan.end_directions
            )
        if code == OK:
            code = self._rolls(plan, plan.pre_asked, plan.post_asked)
        return code

    def _find_directions(self, plan, directions, index, step):
        """directions[motor] = the direction in which it starts from the frame `index` in steps of
        `step`."""
        player = self.player
        r = player.numbers
        for motor in range(player.count):
            directions[motor] = 0
            if (plan.bits >> motor) & 1 and plan.frames and player.axes[motor].backlash[BACKLASH]:
                player.velocity(FRAME_SPEED, motor, index, step)
                directions[motor] = reals.sign(r, FRAME_SPEED) or player.first_direction(
                    motor, index, step, plan.frames + 1
                )

    def _rolls(self, plan, pre_ms, post_ms):
        """Find where the motors wait and where they come to rest (field note 6.2)."""
        player = self.player
        r = player.numbers
        last = plan.first + plan.step * plan.frames
        plan.pre_ms = self._roll_times(plan, plan.first, pre_ms, plan.pre_rolls)
        plan.post_ms = self._roll_times(plan, last, post_ms, plan.post_rolls)
        for motor in range(player.count):
            if (plan.bits >> motor) & 1:
                self.store.position(motor, plan.first, plan.begins, motor)
                self.store.position(motor, last, plan.ends, motor)
                if not plan.frames:
                    continue
                own = SPEEDS + 2 * motor
                player.velocity(own, motor, plan.first, plan.step)
                reals.fetch(r, ROLL_TICKS, plan.pre_rolls, 2 * motor)
                if not self.move_check.apply_roll(motor, own, ROLL_TICKS, True, plan.begins):
                    return self.move_check.blame_roll(
                        EXCEEDED_PREROLL, motor, plan.first, ERR_PREROLL, own, ROLL_TICKS
                    )
                player.velocity(own, motor, last, plan.step)
                reals.fetch(r, ROLL_TICKS, plan.post_rolls, 2 * motor)
                if (plan.loops or plan.turns) and not self.move_check.apply_roll(
                    motor, own, ROLL_TICKS, False, plan.ends
                ):
                    return self.move_check.blame_roll(
                        EXCEEDED_POSTROLL, motor, last, ERR_POSTROLL, own, ROLL_TICKS
                    )
                if not self.find_end(motor, last):
                    return self.move_check.blame_roll(
                        EXCEEDED_POSTROLL, motor, last, ERR_POSTROLL, own, ROLL_TICKS
                    )
                if plan.turns:
                    player.velocity(own, motor, plan.first, -plan.step)
                    reals.fetch(r, ROLL_TICKS, plan.pre_rolls, 2 * motor)
                    if not self.find_end(motor, plan.first):
                        return self.move_check.blame_roll(
                            EXCEEDED_POSTROLL, motor, plan.first, ERR_POSTROLL, own, ROLL_TICKS
                        )
        return OK

    def find_end(self, motor, index):
        """Find where a motor is at the end of the last frame, `index`, and where it comes to rest.

        It keeps the velocity in SPEEDS for the frame's period, and then stops within ROLL_TICKS.
        Return False if that exceeds a limit or the motor's acceleration.
        """
        player = self.player
        r = player.numbers
        lasts = self.lasts
        self.store.position(motor, index, lasts, motor)
        reals.multiply(r, FRAME_SPEED, SPEEDS + 2 * motor, FRAME_TICKS)
        if not self.move_check.shift(lasts, motor, FRAME_SPEED, False):
            return False
        reals.copy_word(self.rests, motor, lasts, motor)
        return self.move_check.apply_roll(motor, SPEEDS + 2 * motor, ROLL_TICKS, False, self.rests)

    def set_durations(self, fps_milli):
        """Set FRAME_TICKS and LONGER_FRAME_TICKS."""
        r = self.player.numbers
        reals.put(r, FRAME_TICKS, MICROSECONDS // fps_milli, 0)
        compute(r, _FRAME_TICKS)

    def _roll_times(self, plan, index, ms, rolls):
        """rolls = ticks of each motor's ramp between rest and its velocity at the frame `index`.

        ms: for all motors. 0: as many as each motor needs with its acceleration (field note 6.2),
        at least two. Return the longest in whole ms.
        """
        player = self.player
        r = player.numbers
        longest = ms
        for motor in range(player.count):
            if (plan.bits >> motor) & 1:
                reals.put(r, ROLL_TICKS, ms, 0)
                if ms == 0 and plan.frames:
                    player.velocity(_SHORTEST_RAMP.velocity, motor, index, plan.step)
                    numbers = player.axes[motor].numbers
                    reals.fetch(r, _SHORTEST_RAMP.acceleration, numbers, MAX_ACCELERATION)
                    # with smoothing, the room that _GENTLE_RAMP of run.py needs
                    reals.put(r, _SHORTEST_RAMP.more, 9 if player.view is player.values else 0, -1)
                    if compute(r, _SHORTEST_RAMP):
                        longest = max(longest, reals.floor(r, ROLL_TICKS, LONGEST_ROLL) + 1)
                reals.fetch(rolls, 2 * motor, r, ROLL_TICKS)
        return longest
