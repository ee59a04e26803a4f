"""A button that shoots the next frame (setting `shoot_input`).

The host shoots one frame of the upload: that sets exposure, window and motors. Each press then
shoots the frame after it. All motors go to that frame; those of the shot go on to where it begins;
it starts as soon as they are there. Whatever stops them on the way, or while their drivers wake up,
ends it; so does a request that sends them elsewhere.

Loaded only if the rig file has `shoot_input`. Nothing allocates after construction.
"""

from framestep.base.native import const
from framestep.base.results import OK
from framestep.moves.frame_positions import all_on_frame
from framestep.moves.operation_runner import POSITIONING, READY
from framestep.moves.shoot import BACKWARD, CLOSED, EXPOSURE, FRAME, MOTORS, OPENED, PERMILLE
from framestep.pulse import stepper

# What is done
_NOTHING = const(0)
_TO_FRAME = const(1)  # motors go to the frame
_PREPARED = const(2)  # to where the shot begins


class NextShot:
    """Shoots the next frame. moves: a Moves, asked whether motors may move."""

    def __init__(self, axes, interlock, moves):
        self.axes = axes
        self.interlock = interlock
        self.moves = moves
        self.operations = moves.operations
        self.player = moves.player
        self.store = moves.store
        self.run_outputs = moves.run_outputs
        self.shoot = moves.shoot
        self.request = self.shoot.request
        self.positions = moves.positions
        self.step = _NOTHING
        self.bits = 0  # of the motors that it waits for
        self.frame = 0

    def press(self):
        """The button has been pressed. Return whether a shot that was ready has started."""
        operations = self.operations
        if operations.busy:
            return operations.operation is self.shoot and self.moves.go_from_input()
        self.frame = self._next_frame()
        if (
            self.request[EXPOSURE]
            and self.moves.may_begin() == OK
            and operations.send_to_frame(self.frame, self.positions) == OK
        ):
            self.run_outputs.show_frame(self.frame - self.store.start)
            self._wait(_TO_FRAME, self.player.motors())
        return False

    def _wait(self, step, bits):
        """Go on once these motors have arrived."""
        self.step = step
        self.bits = bits
        self.interlock.begin_shot(bits)

    def _next_frame(self):
        """Return the scene frame after the last shot, in its direction."""
        return self.request[FRAME] + (-1 if self.request[BACKWARD] else 1)

    def _prepare(self):
        """Prepare the frame like the one before, with all motors along the path. Return a code."""
        r = self.request
        return self.shoot.prepare(
            self.frame,
            r[BACKWARD] != 0,
            r[EXPOSURE],
            r[PERMILLE],
            r[OPENED],
            r[CLOSED],
            0,
            0,
            r[MOTORS],
        )

    def poll(self):
        """Go on if motors have arrived. In each pass in which anything may be planned."""
        operations = self.operations
        if self.interlock.shooting != self.bits:
            self.step = _NOTHING
        if self.step == _TO_FRAME:
            axes = self.axes
            if axes.moving or stepper.waking(axes.kernel.state):
                return
            self.step = _NOTHING
            player = self.player
            index = self.frame - self.store.start
            if (
                not operations.busy
                and self.moves.may_begin() == OK
                and self.request[EXPOSURE]
                and self._next_frame() == self.frame
                and all_on_frame(player, player.motors(), index)
                and self.moves.report_exceeded(self._prepare()) == OK
            ):
                self.interlock.prepare(self.shoot.bits)
                self._wait(_PREPARED, self.shoot.bits)
        elif self.step == _PREPARED:
            if operations.operation is not self.shoot or operations.state != POSITIONING:
                self.step = _NOTHING
                if operations.state == READY and operations.operation is self.shoot:
                    self.moves.go_from_input()
