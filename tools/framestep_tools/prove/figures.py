"""The figures that `framestep prove` measures, and the verdict on each beside the emulated one."""

from dataclasses import dataclass

LESS, MORE, SAME = "less is better", "more is better", "should be the same"
AS_EMULATED, BETTER, WORSE = "as emulated", "better", "worse"
NOT_MEASURED, NOT_COMPARED = "not measured", "not compared"


@dataclass(frozen=True)
class Figure:
    """One figure. slack: how far from the emulated one it may be and count as the same, in its
    unit; share: the same as a part of that figure. The greater of the two holds."""

    key: str
    unit: str
    better: str
    slack: float
    share: float
    how: str

    def verdict(self, measured: float | None, emulated: float | None) -> str:
        """AS_EMULATED, BETTER or WORSE; where one of the two is missing NOT_MEASURED or
        NOT_COMPARED."""
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


_COMPUTED = 0.25  # computing times of the emulator are right to about 20 %
_GRAIN_US = 0.05  # of an edge, with the loop's two cycles
FIGURES = (
    Figure(
        "steps_wrong", "steps", SAME, 0, 0,
        "over all moves: rising edges counted at the pins less the change of the position reported",
    ),
    Figure(
        "rate_350k", "steps/s", MORE, 0, 1e-4,
        "up to four motors, those of a PIO block, at 350 000 steps/s: the slowest of all",
    ),
    Figure(
        "edge_350k_us", "µs", LESS, _GRAIN_US, 0,
        "the same: the farthest that an edge lies from a straight line through them",
    ),
    Figure(
        "rate_together", "steps/s", MORE, 0, 1e-4,
        "as many motors at once as can be watched, at 350 000 steps/s each: all but one, whose "
        "state machine watches each of the others in turn, or all where machines are left",
    ),
    Figure(
        "edge_together_us", "µs", LESS, _GRAIN_US, 0.5, "the same: the farthest edge from the line",
    ),
    Figure("rate_500k", "steps/s", MORE, 0, 1e-4, "one motor at 500 000 steps/s"),
    Figure("edge_500k_us", "µs", LESS, _GRAIN_US, 0, "the same: the farthest edge from the line"),
    Figure(
        "edge_ramp_us", "µs", LESS, 0.5, 0,
        "runs below: the farthest edge from the ideal path while it accelerates by "
        "25 000 steps/s², but for the last step before a standstill",
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
        "a move that is retargeted, turned and stopped hard, at 5000 steps/s: what the least time "
        "between two steps comes to; more would be a jerk",
    ),
    Figure(
        "setup_us_least", "µs", MORE, _GRAIN_US, 0.05,
        "a move to and fro: the least time from a change of direction to the next step",
    ),
    Figure(
        "go_ms", "ms", LESS, 1, 0.1,
        "from the host writing GO to the first frame of a run, less the pre-roll; known to about "
        "a millisecond, as the two clocks are compared over USB",
    ),
    Figure(
        "tick_us", "µs", LESS, 2, _COMPUTED,
        "up to four motors move at 20 000 steps/s: interrupts in a tick of 1000 µs, on average",
    ),
    Figure("tick_us_most", "µs", LESS, 5, _COMPUTED, "the same, the longest at a time"),
    Figure("tick_all_us", "µs", LESS, 3, _COMPUTED, "all motors that are measured move: the same"),
    Figure("tick_all_us_most", "µs", LESS, 5, _COMPUTED, "the same, the longest at a time"),
    Figure("late_us", "µs", LESS, 20, 0.5, "the worst lateness of a tick while anything moved"),
    Figure("pass_us", "µs", LESS, 20, _COMPUTED, "a pass of the main loop then, on average"),
    Figure("pass_us_most", "µs", LESS, 200, 0.5, "the longest of them"),
    Figure("passes_s", "1/s", MORE, 50, 0.3, "how many of them there are in a second"),
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
        "erasing the sector of that file, 4 kB: so long every interrupt is held off",
    ),
    Figure(
        "program_ms", "ms", LESS, 0.2, 1,
        "programming a page of it, 256 bytes: an eighth of what nine in one call take longer than "
        "one",
    ),
    Figure(
        "clock_ppm", "ppm", SAME, 100, 0,
        "the board's microseconds against the host's; a crystal has 30 ppm, a host's clock and USB "
        "are no better over some seconds",
    ),
)  # fmt: skip
# These depend on how many motors there are and on what the rig file asks for
OF_THE_RIG = frozenset(
    {
        *("tick_us", "tick_us_most", "tick_all_us", "tick_all_us_most", "late_us"),
        *("pass_us", "pass_us_most", "passes_s", "reply_ms_median", "reply_ms_most"),
        *("upload_bytes_s", "upload_frames", "heap_bytes"),
    }
)
