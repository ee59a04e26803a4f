"""The figures that `framestep lab prove` measures, and their verdicts against the emulator."""

from dataclasses import dataclass

LESS, MORE, SAME = "less is better", "more is better", "should be the same"
AS_EMULATED, BETTER, WORSE = "as emulated", "better", "worse"
NOT_MEASURED, NOT_COMPARED = "not measured", "not compared"


@dataclass(frozen=True)
class Figure:
    """One figure. slack: largest difference from the emulated one that counts as equal, in its
    unit; share: the same as a part of that figure. The larger of the two applies."""

    key: str
    unit: str
    better: str
    slack: float
    share: float
    how: str

    def verdict(self, measured: float | None, emulated: float | None) -> str:
        """Return AS_EMULATED, BETTER or WORSE; NOT_MEASURED or NOT_COMPARED if one is missing."""
        if measured is None:
            return NOT_MEASURED
        if emulated is None:
            return NOT_COMPARED
        apart = measured - emulated
        if abs(apart) <= max(self.slack, self.share * abs(emulated)):
            return AS_EMULATED
        if self.better == SAME:
            return WORSE
        return BETTER if (apart < 0) == (self.better == LESS) else WORSE


_COMPUTED = 0.25  # the emulator's computing times are right to about 20 %
_GRAIN_US = 0.05  # resolution of an edge, with the loop's two cycles
FIGURES = (
    Figure(
        "steps_wrong", "steps", SAME, 0, 0,
        "over all moves: rising edges at the pins minus the change of the reported position",
    ),
    Figure(
        "rate_350k", "steps/s", MORE, 0, 1e-4,
        "up to four motors, those of a PIO block, at 350 000 steps/s: the slowest of all",
    ),
    Figure(
        "edge_350k_us", "µs", LESS, _GRAIN_US, 0,
        "the same: the farthest edge from a straight line through them",
    ),
    Figure(
        "rate_together", "steps/s", MORE, 0, 1e-4,
        "as many motors at once as can be watched, at 350 000 steps/s each: all but one, whose "
        "state machine watches each of the others in turn, or all if machines are free",
    ),
    Figure(
        "edge_together_us", "µs", LESS, _GRAIN_US, 0.5, "the same: the farthest edge from the line",
    ),
    Figure("rate_500k", "steps/s", MORE, 0, 1e-4, "one motor at 500 000 steps/s"),
    Figure("edge_500k_us", "µs", LESS, _GRAIN_US, 0, "the same: the farthest edge from the line"),
    Figure(
        "edge_ramp_us", "µs", LESS, 0.5, 0,
        "runs below: the farthest edge from the ideal path while it accelerates by "
        "25 000 steps/s², except for the last step before it is at rest",
    ),
    Figure(
        "edge_steady_us", "µs", LESS, 0.2, 0, "runs below: the same at constant velocity",
    ),
    Figure(
        "frame_us_23976", "µs", LESS, 1, 0.2,
        "up to four motors, a run at 23.976 frames/s: the worst distance in time of a frame and "
        "the edge onto its step",
    ),
    Figure("frame_us_24", "µs", LESS, 1, 0.2, "the same at 24 frames/s"),
    Figure("frame_us_60", "µs", LESS, 1, 0.2, "the same at 60 frames/s"),
    Figure(
        "pulse_us_least", "µs", SAME, _GRAIN_US, 0,
        "the shortest pulse of a move, of a motor with the default pulse_us",
    ),
    Figure("pulse_us_most", "µs", SAME, _GRAIN_US, 0, "the longest of them"),
    Figure(
        "turns_rate_most", "steps/s", LESS, 0, 0.01,
        "a move that is retargeted, turned and stopped hard, at 5000 steps/s: the highest rate "
        "between two steps; more would be a jerk",
    ),
    Figure(
        "setup_us_least", "µs", MORE, _GRAIN_US, 0.05,
        "a move to and fro: the least time from a change of direction to the next step",
    ),
    Figure(
        "go_ms", "ms", LESS, 1, 0.1,
        "from the host writing GO to the first frame of a run, minus the pre-roll; known to about "
        "a millisecond, because the two clocks are compared over USB",
    ),
    Figure(
        "tick_us", "µs", LESS, 2, _COMPUTED,
        "up to four motors move at 20 000 steps/s: interrupts in a tick of 1000 µs, on average",
    ),
    Figure("tick_us_most", "µs", LESS, 5, _COMPUTED, "the same, the longest at a time"),
    Figure("tick_all_us", "µs", LESS, 3, _COMPUTED, "the same while all measured motors move"),
    Figure("tick_all_us_most", "µs", LESS, 5, _COMPUTED, "the same, the longest at a time"),
    Figure("late_us", "µs", LESS, 20, 0.5, "the worst lateness of a tick while anything moved"),
    Figure("pass_us", "µs", LESS, 20, _COMPUTED, "a pass of the main loop then, on average"),
    Figure("pass_us_most", "µs", LESS, 200, 0.5, "the longest of them"),
    Figure("passes_s", "1/s", MORE, 50, 0.3, "passes in a second"),
    Figure(
        "reply_ms_median", "ms", LESS, 0.5, 0.5,
        "while up to four motors move: from writing a request to its whole reply, on the host's "
        "clock",
    ),
    Figure("reply_ms_most", "ms", LESS, 5, 0.5, "the slowest of these"),
    Figure("upload_bytes_s", "bytes/s", MORE, 0, 0.2, "an upload of all motors, host's clock"),
    Figure("upload_frames", "frames", MORE, 128, 0.02, "that HI promises"),
    Figure("heap_bytes", "bytes", MORE, 300, 0.05, "free on the REPL before anything is measured"),
    Figure(
        "dmx_break_us", "µs", SAME, 2, 0, "DMX at its pin: how long the line is low before a frame",
    ),
    Figure("dmx_mark_us", "µs", SAME, 2, 0, "the same: the mark after the break"),
    Figure("dmx_slot_us", "µs", SAME, 0.1, 0, "the same: a slot of eleven bits, on average"),
    Figure(
        "file_ms", "ms", LESS, 10, 1,
        "writing a file of 4 kB at rest: sectors of flash erased and programmed",
    ),
    Figure(
        "erase_ms", "ms", LESS, 5, 1,
        "erasing the sector of that file, 4 kB; every interrupt is blocked for this time",
    ),
    Figure(
        "program_ms", "ms", LESS, 0.2, 1,
        "programming a page of it, 256 bytes: an eighth of the difference between nine in one call "
        "and one",
    ),
    Figure(
        "clock_ppm", "ppm", SAME, 100, 0,
        "the board's microseconds against the host's; a crystal has 30 ppm, a host's clock and USB "
        "are not better over some seconds",
    ),
)  # fmt: skip
# These depend on the number of motors and on the rig file
OF_THE_RIG = frozenset(
    {
        *("tick_us", "tick_us_most", "tick_all_us", "tick_all_us_most", "late_us"),
        *("pass_us", "pass_us_most", "passes_s", "reply_ms_median", "reply_ms_most"),
        *("upload_bytes_s", "upload_frames", "heap_bytes"),
    }
)
