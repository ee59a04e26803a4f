"""MSG_RT_SHOOT_FRAME and MSG_RT_SHOOT_FRAME2: go-motion, one frame exposed while the motors move.

SHOOT_FRAME (field note 7.1): the window is the middle part, BLUR, of the path from POS A to POS B,
and the shutter is open throughout it. The motors wait a run-up before the window, cross it at
constant velocity, and come to rest a run-out behind it:

    GO   run-up (1 s)                window                        run-out (1 s)
    rest ........ accelerating a ================= b decelerating ........ rest
                                 ^ shutter opens    ^ closes

SHOOT_FRAME2 (field note 7.3): the motors wait on A, start at GO and come to rest on B, 360 degrees
later. The first and the last eighth are the ramps. The shutter opens and closes at given angles; if
it opens before angle 0, the motors start later by as much.

    0 deg   45                                     315      360
    A accelerating a ============================= b decelerating B
                ^ OPEN, for example           ^ CLOSE

Both consist of the same phases: wait, ramp, window, ramp.
"""

from array import array

from framestep.base.clock import after, reached
from framestep.base.native import const
from framestep.base.results import (
    ERR_GENERAL,
    ERR_POSTROLL,
    ERR_PREROLL,
    ERR_RANGE,
    EXCEEDED_POSTROLL,
    EXCEEDED_PREROLL,
    EXCEEDED_VELOCITY,
    OK,
)
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.motors import bounds
from framestep.motors.rates import MAX_VELOCITY
from framestep.moves.frame_positions import find_blocking_switch
from framestep.moves.operation import Operation
from framestep.moves.path import path, registers
from framestep.moves.path.move_check import HALF
from framestep.moves.path.registers import OPENING, RAMP, SPEEDS, WAIT, WINDOW, ZERO
from framestep.moves.run_outputs import METER, SHUTTER
from framestep.moves.upload.store import READY as UPLOADED
from framestep.pulse import stepper
from framestep.pulse.engine import CUE_DELAY_US

RUN_UP_MS = const(1000)  # field note 7.1: fixed, so that Dragonframe can time its shutter
LONGEST_MS = const(3600000)
DEFAULT_MS = const(1000)  # for EXPOSURE 0 (field note 7.3)
# Reals of Shot.times
_AT_WAIT = const(0)
_AT_RAMP = const(2)
_AT_WINDOW = const(4)
# Words of ShootFrame.request
BACKWARD = const(0)
PERMILLE = const(1)
OPENED = const(2)
CLOSED = const(3)
FRAME = const(4)  # scene number
EXPOSURE = const(5)  # ms; 0: there was none since the upload
MOTORS = const(6)  # bits of those that it moves
_FARTHEST = const(0x3FFFFFFF)  # A and B are less than this many steps apart

# An exposure from one angle to another that is so many degrees farther.
_FULL_TURN = formula(
    registers,
    "exposure, degrees, opens",
    """
    degree = exposure / degrees
    WINDOW = degree * 360
    OPENING = degree * opens
    """,
)
_BEFORE_OPENING = formula(registers, "-> ticks", "ticks = OPENING + RAMP")
# opens: ticks from GO until the shutter opens; late_us: how much later cues come than pulses of the
# same tick
_WAIT = formula(registers, "opens, late_us", "WAIT = opens - OPENING - RAMP + late_us / THOUSAND")
# The ramps are the first and the last eighth of the 360 degrees, which end `ticks` after GO.
_RAMPS_WITHIN = formula(
    registers,
    "-> ticks",
    """
    ticks = WAIT + WINDOW
    RAMP = WINDOW / 8
    WINDOW = WINDOW - RAMP - RAMP
    """,
)
# steps: from A to B. BLUR leaves out some thousandths of them, half at either end. Half a step is
# added so that floor() rounds, in both directions alike.
_LEFT_OUT = formula(
    registers, "steps, permille -> cut", "cut = max(steps, -steps) * permille / 2000 + 0.5"
)
# The length of a ramp: half of the distance that the window covers in the same time.
_RAMP_LENGTH = formula(
    registers, "steps -> cut", "cut = max(steps, -steps) / (WINDOW + RAMP) * RAMP / 2 + 0.5"
)
_FULL_RAMPS = formula(registers, "-> ticks", "ticks = WINDOW + RAMP")
# The velocity exceeds the top velocity, apart from rounding.
_TOO_FAST = formula(
    registers,
    "steps, ticks, top -> velocity",
    """
    velocity = steps / ticks
    assert max(velocity, -velocity) > top + top / 2 ** 20
    """,
    ticks=_FULL_RAMPS.ticks,
)
_STEPS_PER_SECOND = formula(registers, "velocity -> rate", "rate = velocity * THOUSAND")


class Shot:
    """A request, and the values computed for it.

    There are two shots, so that a refusal changes nothing.
    """

    def __init__(self, motors):
        self.bits = 0
        self.index = 0  # of the frame, from the upload's first
        self.exposure_ms = 0
        self.blurs = True  # it is a SHOOT_FRAME, to which the blur flag applies
        self.begin_ms = 0  # from GO until the shutter opens
        self.lasts_ms = 0  # from GO to RT_END
        # reals: ticks from GO to the first ramp, of a ramp, and of constant velocity, from a to b
        self.times = array("i", [0] * 6)
        self.starts = array("i", [0] * motors)  # for each motor: where it waits
        # for each motor: the direction in which it starts, 1 up, -1 down, 0 not at all
        self.directions = array("i", [0] * motors)
        self.a = array("i", [0] * motors)
        self.b = array("i", [0] * motors)
        self.ends = array("i", [0] * motors)  # where it comes to rest


class ShootFrame(Operation):
    """A SHOOT_FRAME or SHOOT_FRAME2; see operation.Operation."""

    def __init__(self, operations, run_outputs):
        Operation.__init__(self, operations)
        self.player = operations.player
        self.move_check = operations.move_check
        self.store = operations.store
        self.run_outputs = run_outputs
        self.shot = Shot(operations.axes.count)
        self.draft = Shot(operations.axes.count)
        self.request = array("i", [0] * 7)  # the last one that was OK
        self.blurred = 0  # bits of motors with the blur flag
        self.done_tick = 0
        self.done = True

    # ---------------------------------------------------------------- the request

    def prepare_blur(self, frame, backward, exposure_ms, permille, listed):
        """Check a SHOOT_FRAME, and move the motors to where it begins.

        frame: scene number. exposure_ms: 0 for DEFAULT_MS. permille: BLUR, 0 … 1000; 0 means 1000.
        listed: bits of the motors whose POS A and POS B are in the draft's `a` and `b`, swapped if
        `backward`; -1 if a listed motor does not exist. Return a code; nothing changes unless it is
        OK.
        """
        if permille > 1000:
            return ERR_RANGE
        return self.prepare(
            frame, backward, exposure_ms, permille or 1000, 0, 360, listed, self.blurred, 0
        )

    def prepare_angles(self, frame, exposure_ms, opened, closed, listed):
        """Check a SHOOT_FRAME2; like prepare_blur(). opened, closed: degrees, signed."""
        if closed <= opened:
            return ERR_RANGE
        return self.prepare(
            frame, False, exposure_ms, 0, opened, closed, listed, 0x3FFFFFFF, self.blurred
        )

    def prepare(self, frame, backward, exposure_ms, permille, opened, closed, listed, may, always):
        """Check a request, and move the motors to where it begins. Return a code.

        permille: 0 for SHOOT_FRAME2. may: bits of the motors that move if they are listed, 0 for
        a frame without a list. always: bits of the motors that move along the path even if a list
        leaves them out."""
        store = self.store
        player = self.player
        if store.state != UPLOADED:
            return ERR_GENERAL
        if (
            listed < 0
            or frame < store.start
            or frame > store.end
            or exposure_ms < 0
            or exposure_ms > LONGEST_MS
        ):
            return ERR_RANGE
        if exposure_ms == 0:
            exposure_ms = DEFAULT_MS
        shot = self.draft
        shot.index = frame - store.start
        shot.exposure_ms = exposure_ms
        shot.blurs = permille > 0
        shot.bits = listed & may & ~player.excluded
        # Without a list, SHOOT_FRAME also takes the motors that blur from the path.
        from_path = always if listed or not may else self.blurred
        from_path &= ~listed & player.motors()
        for motor in range(player.count):
            if (from_path >> motor) & 1 and not self._from_path(
                motor, frame - store.start, backward, shot
            ):
                return ERR_RANGE
        shot.bits |= from_path
        code = self._times(shot, opened, closed, RUN_UP_MS if permille else 0)
        if code == OK:
            code = self._find_positions(shot, permille)
        if code == OK:
            code = find_blocking_switch(player, self.operations.safety, shot.bits, shot.starts)
        if code != OK:
            return code
        self.draft = self.shot
        self.shot = shot
        self.bits = shot.bits
        self.done = True
        request = self.request
        request[BACKWARD] = 1 if backward else 0
        request[PERMILLE] = permille
        request[OPENED] = opened
        request[CLOSED] = closed
        request[FRAME] = frame
        request[EXPOSURE] = exposure_ms
        request[MOTORS] = shot.bits
        self.operations.prepare(self, shot.starts, shot.directions, frame)
        return OK

    def _from_path(self, motor, index, backward, shot):
        """Find A and B on the path, half a frame before and after (field note 7.2).

        Return False if that is too far.
        """
        store = self.store
        player = self.player
        last = store.end - store.start
        before = player.slope(motor, max(index - 1, 0), 1)
        following = player.slope(motor, min(index + 1, last), 1)
        here = player.slope(motor, index, 1)
        window = player.window
        # beyond the ends of the upload the path is a straight line
        if index > 0 and not path.near(window, 1) or index < last and not path.near(window, 3):
            return False
        early = path.midway(window, 1, before, here) if index > 0 else -here // 24
        late = path.midway(window, 3, following, here) if index < last else here // 24
        return reals.add_within(
            shot.b if backward else shot.a, motor, window, 2, early
        ) and reals.add_within(shot.a if backward else shot.b, motor, window, 2, late)

    def _times(self, shot, opened, closed, run_up_ms):
        """Find the durations of the phases; return a code. run_up_ms: 0 for ramps within the 360
        degrees.

        The shutter opens in a whole tick, and the motion is timed to suit it. It opens a little
        later than that tick's pulses come, because cues come later than pulses.
        """
        r = self.player.numbers
        reals.put(r, _FULL_TURN.exposure, shot.exposure_ms, 0)
        reals.put(r, _FULL_TURN.degrees, closed - opened, 0)
        reals.put(r, _FULL_TURN.opens, opened, 0)
        compute(r, _FULL_TURN)
        if (
            reals.floor(r, WINDOW, HALF) > LONGEST_MS
            or not -LONGEST_MS <= reals.floor(r, OPENING, HALF) <= LONGEST_MS
        ):
            return ERR_RANGE
        reals.put(r, RAMP, run_up_ms, 0)
        compute(r, _BEFORE_OPENING)
        delay_ms = self.run_outputs.delay_ms
        shot.begin_ms = max(reals.floor(r, _BEFORE_OPENING.ticks, HALF), delay_ms) + 1
        kernel = self.player.axes.kernel.state
        late = kernel[stepper.LEAD] * kernel[stepper.CYCLES] - kernel[stepper.AHEAD]
        reals.put(r, _WAIT.opens, shot.begin_ms, 0)
        reals.put(r, _WAIT.late_us, late // kernel[stepper.CYCLES_PER_US] + CUE_DELAY_US, 0)
        compute(r, _WAIT)
        shot.lasts_ms = shot.begin_ms + shot.exposure_ms + run_up_ms
        if not run_up_ms:
            compute(r, _RAMPS_WITHIN)
            lasts = reals.floor(r, _RAMPS_WITHIN.ticks, HALF)
            shot.lasts_ms = max(shot.lasts_ms, lasts + 1)
        held_ms = shot.begin_ms + shot.exposure_ms + self.run_outputs.hold_ms
        shot.lasts_ms = max(shot.lasts_ms, held_ms)
        reals.fetch(shot.times, _AT_WAIT, r, WAIT)
        reals.fetch(shot.times, _AT_RAMP, r, RAMP)
        reals.fetch(shot.times, _AT_WINDOW, r, WINDOW)
        return OK

    def _find_positions(self, shot, permille):
        """Find the ends of the window, and where the motors wait and come to rest.

        Return a code.
        """
        player = self.player
        r = player.numbers
        for motor in range(player.count):
            if not (shot.bits >> motor) & 1:
                continue
            own = SPEEDS + 2 * motor
            reals.put_difference(r, own, shot.b, motor, shot.a, motor)
            if not -_FARTHEST < reals.floor(r, own, _FARTHEST) < _FARTHEST:
                return ERR_RANGE
            shot.directions[motor] = reals.sign(r, own)
            if permille:
                reals.copy(r, _LEFT_OUT.steps, own)
                reals.put(r, _LEFT_OUT.permille, 1000 - permille, 0)
                compute(r, _LEFT_OUT)
                cut = reals.floor(r, _LEFT_OUT.cut, _FARTHEST)
            else:
                reals.copy_word(shot.starts, motor, shot.a, motor)
                reals.copy_word(shot.ends, motor, shot.b, motor)
                reals.copy(r, _RAMP_LENGTH.steps, own)
                compute(r, _RAMP_LENGTH)
                cut = reals.floor(r, _RAMP_LENGTH.cut, _FARTHEST)
            if shot.directions[motor] < 0:
                cut = -cut
            reals.add_word(shot.a, motor, shot.a, motor, cut)
            reals.add_word(shot.b, motor, shot.b, motor, -cut)
            if self._too_fast(shot, motor):
                return self._blame_velocity(shot, motor)
            if permille:
                reals.copy_word(shot.starts, motor, shot.a, motor)
                reals.copy_word(shot.ends, motor, shot.b, motor)
                if not self.move_check.apply_roll(motor, own, RAMP, True, shot.starts):
                    return self._blame_ramp(EXCEEDED_PREROLL, shot, motor, ERR_PREROLL)
                if not self.move_check.apply_roll(motor, own, RAMP, False, shot.ends):
                    return self._blame_ramp(EXCEEDED_POSTROLL, shot, motor, ERR_POSTROLL)
            else:
                code = self._check_ramps(shot, motor)
                if code != OK:
                    return code
        return OK

    def _check_ramps(self, shot, motor):
        """Check a motor's ramps: their steepness, and their ends against its limits. Return a
        code."""
        player = self.player
        axis = player.axes[motor]
        if self.move_check.too_steep(motor, SPEEDS + 2 * motor, RAMP):
            code = ERR_PREROLL if shot.blurs else ERR_RANGE
            return self._blame_ramp(EXCEEDED_PREROLL, shot, motor, code)
        if bounds.beyond(axis, shot.starts, motor):
            return self._blame_ramp(EXCEEDED_PREROLL, shot, motor, ERR_PREROLL)
        if bounds.beyond(axis, shot.ends, motor):
            return self._blame_ramp(EXCEEDED_POSTROLL, shot, motor, ERR_POSTROLL)
        return OK

    def _blame_ramp(self, what, shot, motor, code):
        return self.move_check.blame_roll(what, motor, shot.index, code, SPEEDS + 2 * motor, RAMP)

    def _too_fast(self, shot, motor):
        """Find a motor's velocity in the window. Return whether it exceeds its top velocity, or
        would do so without the rounding of its ramps."""
        player = self.player
        r = player.numbers
        own = SPEEDS + 2 * motor
        if not shot.blurs:
            compute(r, _FULL_RAMPS)
            reals.put_difference(r, _TOO_FAST.steps, shot.ends, motor, shot.starts, motor)
            reals.fetch(r, _TOO_FAST.top, player.axes[motor].numbers, MAX_VELOCITY)
            if compute(r, _TOO_FAST):
                reals.copy(r, own, _TOO_FAST.velocity)
                return True
        reals.copy(r, _TOO_FAST.ticks, WINDOW)
        reals.put_difference(r, _TOO_FAST.steps, shot.b, motor, shot.a, motor)
        reals.fetch(r, _TOO_FAST.top, player.axes[motor].numbers, MAX_VELOCITY)
        too_fast = compute(r, _TOO_FAST)
        reals.copy(r, own, _TOO_FAST.velocity)
        return too_fast

    def _blame_velocity(self, shot, motor):
        """Note the excess of a motor's velocity that _too_fast() has found. Return the code."""
        player = self.player
        self.move_check.blame(EXCEEDED_VELOCITY, motor, shot.index, ERR_RANGE)
        r = player.numbers
        reals.copy(r, _STEPS_PER_SECOND.velocity, SPEEDS + 2 * motor)
        compute(r, _STEPS_PER_SECOND)
        self.move_check.note_excess(_STEPS_PER_SECOND.rate, player.axes[motor].velocity)
        return ERR_RANGE

    def recheck(self, waiting):
        player = self.player
        shot = self.shot
        if shot.blurs and shot.bits & ~self.blurred:
            return ERR_GENERAL
        self.begin_lap()
        for motor in range(player.count):
            if (shot.bits >> motor) & 1:
                if self._too_fast(shot, motor):
                    return self._blame_velocity(shot, motor)
                code = self._check_ramps(shot, motor)
                if code != OK:
                    return code
        return OK

    def heading(self, motor):
        return self.shot.directions[motor]

    # ---------------------------------------------------------------- the exposure

    def begin_lap(self):
        player = self.player
        r = player.numbers
        shot = self.shot
        reals.fetch(r, WINDOW, shot.times, _AT_WINDOW)
        reals.fetch(r, WAIT, shot.times, _AT_WAIT)
        reals.fetch(r, RAMP, shot.times, _AT_RAMP)

    def queue_first_phases(self, motor):
        player = self.player
        r = player.numbers
        shot = self.shot
        own = SPEEDS + 2 * motor
        reals.put_difference(r, own, shot.b, motor, shot.a, motor)
        reals.divide(r, own, own, WINDOW)
        axis = player.axes[motor]
        axis.append_phase(WAIT, ZERO, ZERO, r, shot.starts, motor)
        axis.append_phase(RAMP, ZERO, own, r, shot.a, motor)
        axis.append_phase(WINDOW, own, own, r, shot.b, motor)
        axis.append_phase(RAMP, own, ZERO, r, shot.ends, motor)
        axis.set_more_to_come(False)

    def started(self, tick):
        self.done = False
        shot = self.shot
        run_outputs = self.run_outputs
        opens = tick + shot.begin_ms
        closes = opens + shot.exposure_ms + run_outputs.hold_ms
        run_outputs.schedule(tick, METER, METER)
        run_outputs.schedule(opens - run_outputs.delay_ms, SHUTTER, SHUTTER)
        run_outputs.schedule(closes, SHUTTER | METER, 0)
        self.done_tick = after(tick, shot.lasts_ms)
        self.operations.axes.alarm(after(self.done_tick, -1))

    def frame_reached(self, ticks):
        if not self.done and reached(ticks, self.done_tick):
            self.done = True
            self.operations.axes.alarm(-1)
        return False

    def finished(self):
        return self.done

    def ended(self):
        if not self.done:
            self.done = True
            self.run_outputs.drop_scheduled()
            self.run_outputs.schedule(
                self.player.axes.kernel.state[stepper.TICKS] + 1, SHUTTER | METER, 0
            )
            self.run_outputs.hand_over()
