"""Base class of a run, an exposure and a jog of all motors, for operation_runner.py."""

from framestep.base.native import micropython
from framestep.base.results import OK


class Operation:
    """What a kind of operation adds to the state machine. operations: the OperationRunner.

    The methods here do the least possible. `tick` and `ticks` count modulo 2^29. Nothing allocates.
    """

    sends_rt_end = True  # its end is reported to the host by RT_END
    at_once = True  # play_head() is a kernel, which answers.py calls

    def __init__(self, operations):
        self.operations = operations
        self.bits = 0  # motors that belong to it

    # Queueing

    def begin_lap(self):
        """Prepare for a lap. Then comes queue_first_phases() for each motor."""

    def queue_first_phases(self, motor):
        """Queue a motor's first phases. It is prepared and at rest on its start position."""

    def feed(self):
        """Queue further phases, of one frame at most. Return whether there were any."""
        return False

    def started(self, tick):
        """Take note that the motors have been released. `tick`: of the first pulses."""

    # Progress

    def frame_reached(self, ticks):
        """Return whether a frame to be reported has been reached.

        ticks: the tick whose pulses are going out now.

        Called in each pass of the main loop from the tick on that was given to `axes.alarm`.
        """
        return False

    @micropython.viper
    def play_head(self, tick: int, frame: int) -> int:
        """Return MOVE TIME, in thousandths of a scene frame, once the pulses of `tick` are made.

        frame: take the frame reached last instead. If the result is exactly a frame, set
        `operations.reported_frame` to its index.
        """
        return int(self.operations.move_time)

    def finished(self):
        """Return whether everything is queued and reported; the motors may still be moving."""
        return True

    # Passes

    def next_lap(self):
        """Return whether another lap follows.

        If so, set `start_positions` and `directions` of `operations`.
        """
        return False

    def still_wanted(self):
        """Return whether the lap announced by next_lap() should still run, now that the motors
        are in place."""
        return True

    def recheck(self, waiting):
        """Return OK, or the code that refuses the operation with the present settings.

        waiting: before GO, so the motors must be at rest where it would begin now; otherwise the
        check is for the next lap.
        """
        return OK

    def heading(self, motor):
        """Return the direction in which a motor starts: 1 up, -1 down, 0 not at all."""
        return 0

    # End

    def stop_on_frame(self, everything):
        """Stop on a frame by phases of its own. everything: for a STOP_ALL.

        Return False if it cannot; then the motors are ramped down.
        """
        return False

    def stopping_on_frame(self):
        """Return whether it stops on a frame for a STOP_ALL; the next one then stops by ramps."""
        return False

    def ended(self):
        """Clean up after the end, however it came about. May be called more than once."""

    def leave_end(self):
        """Send the motors on from the end of the last lap. RT_END is due by then."""
