"""The figures, their goals, and their table."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from rich.table import Table


@dataclass(frozen=True)
class Figure:
    """One figure: its key in bench.json, its unit, its goal, and its measurement."""

    key: str
    unit: str
    at_least: float | None
    at_most: float | None
    how: str

    def at(self, mhz: int) -> "Figure":
        """Return the figure with its goal at a clock of the processor."""
        goal = AT_200.get(self.key) if mhz == 200 else None
        if goal is None:
            return self
        if self.at_least is None:
            return replace(self, at_most=goal)
        return replace(self, at_least=goal)

    @property
    def goal(self) -> str:
        """Return the goal for the table."""
        if self.at_least is not None:
            return f"≥ {number(self.at_least)}"
        return "–" if self.at_most is None else f"≤ {number(self.at_most)}"

    def shortfall(self, value: float, where: str = "") -> str:
        """Return a line that says by how much the goal is missed."""
        return f"{self.key}{where}: {number(value)} {self.unit}, the goal is {self.goal}"

    def reached(self, value: float) -> bool | None:
        """Return whether the goal is reached, or None without a goal."""
        if self.at_least is not None:
            return value >= self.at_least
        return None if self.at_most is None else value <= self.at_most


FIGURES = (
    Figure(
        "steps_per_s_8",
        "steps/s",
        350_000,
        None,
        "rising edges of each motor from its first to its last frame over that time, "
        "for the slowest of the eight, in the fastest move at constant velocity with every edge "
        "within 0.5 µs of the ideal and no fault; the highest setting is 500 000",
    ),
    Figure("steps_per_s_1", "steps/s", 500_000, None, "the same for one motor, the others at rest"),
    Figure(
        "pulses_steps_per_s_8",
        "steps/s",
        300_000,
        None,
        "as steps_per_s_8, with step inputs that need each level for 1.5 µs",
    ),
    Figure(
        "both_edges_steps_per_s_8",
        "steps/s",
        500_000,
        None,
        "the same with steps on both edges, so rising and falling edges count",
    ),
    Figure("both_edges_steps_per_s_4", "steps/s", 500_000, None, "the same for four motors"),
    Figure("both_edges_steps_per_s_2", "steps/s", 500_000, None, "the same for two motors"),
    Figure("both_edges_steps_per_s_1", "steps/s", 500_000, None, "the same for one motor"),
    Figure(
        "edge_error_steady_us",
        "µs",
        None,
        0.5,
        "pins: worst distance of a rising edge from where the ideal path crosses that step, "
        "at constant velocity, of eight motors at 1 000 to 99 700 steps/s; "
        "each motor has its own origin of time, the median of its edges",
    ),
    Figure(
        "edge_error_ramp_us",
        "µs",
        None,
        1.5,
        "the same while the path accelerates: "
        "ramps of 100 000 steps/s² of all eight motors, except for the last step before rest",
    ),
    Figure(
        "frame_error_us",
        "µs",
        None,
        5,
        "pins: worst distance of the edge onto a frame's step from where the ideal path crosses "
        "it, over all frames in motion; one origin of time for all motors",
    ),
    Figure(
        "velocity_ripple",
        "",
        None,
        0.25,
        "pins: rms of the velocity against the path before it was rounded to steps, divided by the "
        "same with smoothing: false in the rig file; lines, eases and sines of 0.4 to 500 "
        "steps/frame of eight motors at 12, 24 and 60 frames/s",
    ),
    Figure("acceleration_ripple", "", None, 0.15, "the same of the acceleration"),
    Figure(
        "smoothing_load_percent",
        "%",
        None,
        None,
        "emulated clock: share of the processor's time in these runs at 60 frames/s, minus the "
        "same with smoothing: false",
    ),
    Figure(
        "tick_us_8",
        "µs",
        None,
        60,
        "emulated clock: cycles spent in the timer's interrupt per millisecond of the mixed move, "
        "including entry and exit",
    ),
    Figure(
        "tick_late_us_worst",
        "µs",
        None,
        200,
        "the firmware's own count: the worst lateness of a tick in motion over a fixed set of "
        "requests in motion: moves, runs, JOG_ALL, virtual axes, questions, every kind of stop",
    ),
    Figure(
        "cpu_load_8_percent",
        "%",
        None,
        None,
        "emulated clock: share of the mixed move in which the processor did not sleep",
    ),
    Figure(
        "upload_frames_8",
        "frames",
        10_000,
        None,
        "HI's UPLOAD FRAME COUNT with the code frozen into the firmware; "
        "as many are then uploaded for eight motors",
    ),
    Figure(
        "light_channels_with_2000_frames",
        "channels",
        32,
        None,
        "channels with a random level at every frame that fit next to eight motors' mixed motion "
        "and a trigger on each frame of an upload of 2 000",
    ),
    Figure(
        "rx_bytes_per_s",
        "bytes/s",
        450_000,
        None,
        "emulated clock: bytes of that upload over its time, first byte to last answer, "
        "while eight motors move and positions are reported "
        "(no move can be played while it is uploaded)",
    ),
    Figure(
        "rx_bytes_per_s_small",
        "bytes/s",
        145_000,
        None,
        "the same in sections of 16 positions, of 2 000 frames",
    ),
    Figure(
        "rx_bytes_per_s_single_port",
        "bytes/s",
        80_000,
        None,
        "as rx_bytes_per_s, of 1 000 frames, with ports: 1 in the rig file",
    ),
    Figure(
        "reply_ms_median",
        "ms",
        None,
        0.6,
        "emulated clock: from the host writing a request to its whole reply, "
        "without pauses right after GO and then at random moments of that move, "
        "which is played four times",
    ),
    Figure("reply_ms_max", "ms", None, 3, "the slowest of these"),
    Figure(
        "go_ms_median",
        "ms",
        None,
        4,
        "emulated clock, pins: from the host writing GO to the start of the pre-roll's motion, "
        "as calculated from its first edges; 400 runs of six moves of one to eight motors, "
        "at random moments",
    ),
    Figure("go_ms_spread", "ms", None, 0.8, "the longest of these minus the shortest"),
    Figure(
        "stop_ms_worst",
        "ms",
        None,
        2,
        "emulated clock, the tick's own velocities: from the host writing STOP_ALL or a STOP to "
        "the first slower tick of each motor that it stops; in moves of eight motors, in a run, in "
        "a SHOOT_FRAME and in a JOG_ALL, at 350 moments of 110 ms each, and in passes that carry "
        "out other requests",
    ),
    Figure(
        "virtual_stop_ms_worst",
        "ms",
        None,
        2,
        "the same, until a boom-swing-track rig is slower than it would be at that tick, "
        "in a virtual move and in a jog on line",
    ),
    Figure(
        "virtual_reply_ms_max",
        "ms",
        None,
        3,
        "the same, the slowest, while a boom-swing-track rig of six motors "
        "does a virtual move and a jog on line; "
        "the requests that start and stop them are not counted",
    ),
    Figure(
        "heap_bytes_per_hour",
        "bytes/h",
        None,
        0,
        "gc.mem_alloc() after the mixed move minus its value before, with the collector off, "
        "scaled to an hour",
    ),
    Figure(
        "virtual_update_us",
        "µs",
        None,
        None,
        "the board's clock: from a boom-swing-track pose to the steps of six motors, "
        "with nodal offset and boom table, nothing playing; "
        "a virtual axis in motion needs it for each knot",
    ),
)


# Goals at 200 MHz that differ from those at 125 MHz
AT_200 = {
    "tick_us_8": 38,
    "rx_bytes_per_s": 800_000,
    "rx_bytes_per_s_small": 260_000,
    "reply_ms_median": 0.4,
    "reply_ms_max": 2,
    "virtual_reply_ms_max": 2,
    "go_ms_median": 3.3,
    "go_ms_spread": 0.5,
}


def keyed(modelled: Mapping[int, Mapping[str, float]]) -> dict[str, float]:
    """Return the figures at each clock under the keys of bench.json: those at 200 MHz end in
    _200."""
    return {
        key if mhz == 125 else f"{key}_{mhz}": value
        for mhz, figures in modelled.items()
        for key, value in figures.items()
    }


def number(value: float) -> str:
    if isinstance(value, int) or value >= 1000:
        return f"{value:,.0f}".replace(",", " ")
    return f"{value:.3g}"


def table(
    modelled: Mapping[int, Mapping[str, float]], ideal: Mapping[str, float], explain: bool = False
) -> Table:
    """Return a table of the figures and their goals at each clock (MHz) with the flash-cache model,
    and without it at the lowest."""
    result = Table(title="RP2040, emulated", title_justify="left", show_lines=explain)
    result.add_column("figure", no_wrap=True)
    slowest = min(modelled)
    for mhz in modelled:
        for name in (f"{mhz} MHz", "goal", ""):
            result.add_column(name, justify="right", no_wrap=True)
    result.add_column(f"{slowest} MHz, no cache misses", justify="right")
    result.add_column("unit", no_wrap=True)
    if explain:
        result.add_column("how")
    for figure in FIGURES:
        cells = [figure.key]
        for mhz, figures in modelled.items():
            value = figures[figure.key]
            goal = figure.at(mhz)
            verdict = {True: "[green]reached[/]", False: "[red]missed[/]", None: ""}
            cells += [number(value), goal.goal, verdict[goal.reached(value)]]
        cells += [number(ideal[figure.key]), figure.unit]
        result.add_row(*cells, *([figure.how] if explain else []))
    return result


def missed(modelled: Mapping[int, Mapping[str, float]]) -> list[str]:
    """Return a line for each goal that is missed at a clock (MHz), with the flash-cache model."""
    return [
        figure.at(mhz).shortfall(figures[figure.key], f" at {mhz} MHz")
        for mhz, figures in modelled.items()
        for figure in FIGURES
        if figure.at(mhz).reached(figures[figure.key]) is False
    ]


def plain_table(
    title: str, figures: Sequence[Figure], values: Mapping[str, float], explain: bool = False
) -> Table:
    """Return a table of the figures of one chip and their goals."""
    result = Table(title=title, title_justify="left")
    for name in ("figure", "value", "goal", "", "unit", *(["how"] if explain else [])):
        result.add_column(name)
    for figure in figures:
        value = values[figure.key]
        verdict = {True: "[green]reached[/]", False: "[red]missed[/]", None: ""}
        cells = [figure.key, number(value), figure.goal, verdict[figure.reached(value)]]
        result.add_row(*cells, figure.unit, *([figure.how] if explain else []))
    return result


def all_missed(figures: Sequence[Figure], values: Mapping[str, float]) -> list[str]:
    """Return a line for each goal of these figures that is missed."""
    return [
        figure.shortfall(values[figure.key])
        for figure in figures
        if figure.reached(values[figure.key]) is False
    ]


TRUST = (
    "Computing times of the emulator have been checked against a real board only "
    "by MicroPython's own benchmarks: they run at 0.91 of the speed published for a Pico, "
    "at 1.12 without cache misses, single ones at 0.6 to 1.26 (make emulator-measure, "
    "tools/framestep_emulator/README.md). Take what rests on computing time as right to about "
    "20 %. "
    "Edges are exact to the clock cycle of the model of the PIO."
)
