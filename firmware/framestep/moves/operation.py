"""What a run, an exposure or a jog of all motors is to the state machine in state_machine.py."""

from framestep.base.results import OK


class Operation:
    """What a kind of operation adds to the state machine. operations: the OperationRunner.

    Methods that are not overridden here do the least. `tick` and `ticks` count modulo 2^29. Nothing
    allocates.
    """

    sends_rt_end = True  # the host is told of the end by RT_END

    def __init__(self, operations):
        self.operations = operations
        self.bits = 0  # motors that take part

    # What it queues

    def begin_pass(self):
        """Prepare for a pass: queue_first_phases() of each motor is next."""

    def queue_first_phases(self, motor):
        """Queue a motor's first phases. It has been prepared and stands on its start position."""

    def feed(self):
        """Queue further phases, of one frame at most. Returns whether there were any."""
        return False

    def started(self, tick):
        """The motors have been released; `tick` is that of the first pulses."""

    # How far it is

    def frame_reached(self, ticks):
        """Whether a frame to be reported has been reached.

        ticks: tick whose pulses are going out now.

        Asked in each pass of the main loop from the tick on that was given to `axes.alarm`.
        """
        return False

    def play_head(self, tick, frame):
        """MOVE TIME, in thousandths of a scene frame, when the pulses of `tick` have been made.

        frame: take the frame reached last instead. Where the answer is exactly a frame, its index
        is left in `operations.reported_frame`.
        """
        return self.operations.move_time

    def finished(self):
        """Whether everything has been queued and reported; the motors may still be moving."""
        return True

    # Passes

    def next_pass(self):
        """Whether another pass follows.

        If so, `start_positions` and `directions` of `operations` are set.
        """
        return False

    def still_wanted(self):
        """Whether the pass announced by next_pass() is to be run, now that the motors are in
        place."""
        return True

    def recheck(self, waiting):
        """OK, or the code with which its request would be refused with the present settings.

        waiting: before GO, so the motors must stand where it would begin now; otherwise the next
        pass is meant.
        """
        return OK

    def heading(self, motor):
        """The direction in which a motor sets out: 1 up, -1 down, 0 not at all."""
        return 0

    # How it ends

    def stop_on_frame(self, everything):
        """Asked to stop gently, if `everything` by a STOP_ALL.

        True if it does so by phases of its own.
        """
        return False

    def stopping_on_frame(self):
        """Whether it is coming to rest after a STOP_ALL: then the next STOP_ALL is not gentle."""
        return False

    def ended(self):
        """It has ended, however that came about. May be called more than once."""

    def leave_end(self):
        """It has come to its end, and RT_END is due: send the motors on from there."""
