"""The sessions of these tests on the simulated ESP32-S3 instead of the host simulation: `--target
esp32`. A board there takes the host's place with the same interface; its protocol is on USB.

Rig files here have a Pico's pins. They become the S3's. Pulses come EARLIER_NS later than on the
host, after the queue of I2S, and so do the reports of positions. Tests compare edges either with
requests or with reports, or with the present. So a test gets edges with times that are this much
earlier, unless WITH_REPORTS names it.
"""

import contextlib
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import pytest

from framestep_tools.building.board_files import board_data
from framestep_tools.judge.trace import Edge
from framestep_tools.simulator.esp32_board import Esp32Board

NAME = "esp32_s3_595"
# A Pico's general pins, gio1 to gio4, of which the first two are outputs by default; and what takes
# their place: a chip's pin for an input, an output of the chain for an output
GENERAL = (22, 26, 27, 28)
INPUTS = dict(zip(GENERAL, (15, 16, 17, 18), strict=True))
OUTPUTS = dict(zip(GENERAL, (83, 84, 85, 86), strict=True))
SERVOS = (12, 13, 14, 21, 38, 39, 40, 41)  # a chip's pin for each motor's servo
_SIGNALS = {f"out{number}": f"gio{number}" for number in range(1, 5)}


EARLIER_NS = 25_000_000
_QUEUE_NS = 30_000_000  # by then what the ticks have commanded has been played
_shift_ns = EARLIER_NS  # of the running test

# Why a test is not played here
INSIDE = "it looks or reaches into the host simulation"
BOARDS = "it is about another board, or about the host simulation's own pins"
LIGHTS = "DMX leaves a UART there, so it is not among the edges (host_tests/esp32/test_lines.py)"
GRID = "edges lie on a grid of 4 µs there, and it measures more finely than that"
QUEUE = "it measures when a request takes effect, more finely than the queue of I2S allows"
E_STOP = "the E-stop ends all pulses at once there, without a ramp (host_tests/esp32/test_board.py)"
MEMORY = "its upload fits into that board's memory"
PULSES = "pulses of 4 µs do not allow its velocity"
NO_TIME = "it looks for a level of no duration, which words of 4 µs cannot have"
SERVO = (
    "machine.PWM sets widths in steps of 0.3 µs, and a period late at most "
    "(host_tests/esp32/test_lines.py)"
)
# File or test -> why
EXCLUDED = {
    "hosts/test_between_passes.py": INSIDE,
    "hosts/test_boards.py": BOARDS,
    "hosts/test_refusals.py": INSIDE,
    "hosts/test_stalled_frames.py": INSIDE,
    "hosts/test_command_line.py::test_a_section_that_does_not_fit_is_reported": MEMORY,
    "io/test_in_a_pass.py": INSIDE,
    "io/test_io.py::test_lights_at_once": LIGHTS,
    "io/test_io.py::test_a_ramp_is_a_straight_line_of_half_a_second": LIGHTS,
    "io/test_io.py::test_outputs_go_to_their_safe_levels": LIGHTS,
    "io/test_io.py::test_go_from_an_input_is_reported_once_the_host_listens": INSIDE,
    "io/test_led.py": INSIDE,
    "io/test_load.py::test_little_queued_is_a_warning": INSIDE,
    "io/test_stop_inputs.py::test_estop[1-moves]": E_STOP,
    "io/test_stop_inputs.py::test_estop[4-moves]": E_STOP,
    "io/test_stop_inputs.py::test_a_pin_that_something_else_has_taken": INSIDE,
    "motors/test_drivers.py": BOARDS,
    "motors/test_enable.py::test_homing_waits": INSIDE,
    "motors/test_enable.py::test_a_stop_while_homing_waits": INSIDE,
    "motors/test_gantry.py": INSIDE,
    "motors/test_homing.py": INSIDE,
    "motors/test_off_after.py::test_it_is_switched_off_at_rest": BOARDS,
    "motors/test_off_after.py::test_drivers_on_one_pin": BOARDS,
    "motors/test_off_after.py::test_a_host_that_has": BOARDS,
    "motors/test_pendant.py": BOARDS,
    "motors/test_shared_switches.py": INSIDE,
    "motors/test_jogs.py::test_jog_speed": GRID,
    "motors/test_jogs.py::test_soft_limits_hold_for_what_is_gentler_under_way[a jog with": QUEUE,
    "motors/test_jogs.py::test_soft_limits_hold_for_what_is_gentler_under_way[a move with": QUEUE,
    "motors/test_jogs.py::test_soft_limits_hold_for_what_is_gentler_under_way[a slower": QUEUE,
    "motors/test_jogs.py::test_soft_limits_hold_for_what_is_gentler_under_way[a stop with": QUEUE,
    "motors/test_jogs.py::test_a_soft_limit_set_as_it_comes_to_rest": QUEUE,
    "motors/test_motor_options.py::test_ramps_keep_the_jerk": GRID,
    "motors/test_motor_options.py::test_a_stop_keeps_the_jerk": GRID,
    "motors/test_motor_options.py::test_a_jog_let_go_keeps_the_jerk": GRID,
    "motors/test_set_in_motion.py::test_homing": INSIDE,
    "motors/test_motors.py::test_retarget_nearer_than_it_can_stop": QUEUE,
    "motors/test_motors.py::test_positions_in_motion[30]": QUEUE,
    "runs/test_loops.py::test_stop_loop[1-2.01-2-1]": QUEUE,
    "runs/test_loops.py::test_stop_loop_late_in_a_lap": QUEUE,
    "runs/test_loops.py::test_lights_alone": QUEUE,
    "runs/test_runs.py::test_run_reported": QUEUE,
    "motors/test_motor_settings.py::test_configure": BOARDS,
    "motors/test_motor_settings.py::test_fastest_speed_depends_on_the_pulse": PULSES,
    "motors/test_motor_settings.py::test_set_speed[480000": PULSES,
    "motors/test_position_messages.py::test_at_rest_after_an_absence": INSIDE,
    "motors/test_position_messages.py::test_in_a_burst_of_requests": INSIDE,
    "motors/test_positions.py::test_a_command_that_finds_its_fifo_full": INSIDE,
    "motors/test_positions.py::test_pulses_that_broke_off": INSIDE,
    "motors/test_positions.py::test_stops_that_lose_nothing": INSIDE,
    "motors/test_positions.py::test_the_repl_says_so_in_words": INSIDE,
    "motors/test_positions.py::test_the_status_command_says_so": INSIDE,
    "motors/test_servos.py::test_no_pulses_before_it_is_to_move": SERVO,
    "motors/test_servos.py::test_pulses_from_power_up": SERVO,
    "motors/test_servos.py::test_ends_of_the_range": SERVO,
    "motors/test_servos.py::test_widths_with_many_steps": SERVO,
    "motors/test_servos.py::test_widths_follow_an_uploaded_move": SERVO,
    "motors/test_servos.py::test_finer_than_a_step": SERVO,
    "motors/test_servos.py::test_it_is_always_known": INSIDE,
    "motors/test_servos.py::test_fault_releases_it": INSIDE,
    "motors/test_servos_together.py": SERVO,
    **{
        f"runs/test_accuracy.py::test_every_rate[{fps}-exact]": GRID
        for fps in (1, 12, 23.976, 24, 25, 29.97, 30, 60)
    },
    "runs/test_camera.py::test_all_at_once_at_extreme_rates": NO_TIME,
    "runs/test_check.py": INSIDE,
    "runs/test_lights_and_triggers.py::test_lights_and_triggers": LIGHTS,
    "runs/test_lights_and_triggers.py::test_lights_in_a_loop": LIGHTS,
    "runs/test_lights_and_triggers.py::test_no_room_for_more": MEMORY,
    "runs/test_lights_and_triggers.py::test_position_frame_sets_lights": LIGHTS,
    "runs/test_lights_and_triggers.py::test_bloop[": LIGHTS,
    "runs/test_lights_and_triggers.py::test_bloop_outlives_its_run": LIGHTS,
    "runs/test_lights_and_triggers.py::test_bloop_outlives_a_stop": LIGHTS,
    "runs/test_lights_and_triggers.py::test_bloop_and_another_run": LIGHTS,
    "runs/test_lights_and_triggers.py::test_bloop_and_safe_levels": LIGHTS,
    "runs/test_play.py::test_lights_and_outputs_play_with_it": LIGHTS,
    "runs/test_realtime_states.py::test_refusals_and_questions": INSIDE,
    "runs/test_realtime_states.py::test_accepted": INSIDE,
    "runs/test_realtime_states.py::test_landing": INSIDE,
    "runs/test_return_to_start.py::test_the_last_frame_lasts_its_period": GRID,
    "runs/test_run_refusals.py::test_the_sharpest_corners_that_the_board_can_make": PULSES,
    "runs/test_smoothing.py": PULSES,
    "runs/test_turning_points.py": PULSES,
    "runs/test_upload_memory.py": INSIDE,
    "runs/test_uploads.py::test_sections_that_fill_the_largest_frame": LIGHTS,
    "shoot/test_shoot.py": QUEUE,
    "shoot/test_shooting.py::test_a_stop_ends_the_sequence": INSIDE,
}
WITH_REPORTS = (
    "motors/test_position_messages.py",
    "motors/test_motors.py::test_positions_in_motion",
    "runs/test_camera.py::test_stills",
    "runs/test_jog_all.py::test_lower_and_higher_speed_under_way",
    "runs/test_jog_all_limits.py::test_only_the_frames_between_count",
    "runs/test_loops.py::test_rolls_of_no_time",
)


def _name(item: pytest.Item) -> str:
    """Return a test's name as above: io/test_io.py::test_outputs."""
    return item.nodeid.rpartition("end_to_end/")[2]


class Esp32Sessions:
    """A plugin of pytest for `--target esp32`."""

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(
        self, config: pytest.Config, items: list[pytest.Item]
    ) -> None:
        """Leave out what is excluded, and refuse an exclusion that excludes nothing."""
        names = [_name(item) for item in items]
        for excluded in (*EXCLUDED, *WITH_REPORTS):
            file = excluded.partition("::")[0]
            here = [name for name in names if name.startswith(file)]
            if here and not any(name.startswith(excluded) for name in here):
                raise pytest.UsageError(f"there is no test {excluded}")
        left_out = [item for item in items if _name(item).startswith(tuple(EXCLUDED))]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in left_out]

    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        global _shift_ns
        _shift_ns = 0 if _name(item).startswith(WITH_REPORTS) else EARLIER_NS


class Inside:
    """What HostBoard offers beyond Board, as far as it can be done from outside."""

    def __init__(self, board: "Esp32Target"):
        self._board = board

    def set_input(self, name: int | str, level: int) -> None:
        board = self._board
        data = board.rig.board
        if isinstance(name, int):
            pin = INPUTS.get(name, name)
        elif name == "estop":
            pin = data["estop"]
        else:
            pin = INPUTS[GENERAL[int(name.removeprefix("gio")) - 1]]
        board.set_pin(pin, level)

    @property
    def controller(self) -> Any:
        return SimpleNamespace(rig=self._board.rig)

    def __getattr__(self, name: str) -> Any:
        raise AssertionError(f"{name} is inside the board")


class Esp32Target(Esp32Board):
    """In the place of boards.SimulatedBoard."""

    def __init__(
        self, rig: Mapping[str, Any] | None = None, motors: int | None = None, **more: Any
    ):
        assert not more, f"this board has no {', '.join(more)}"
        count = len(board_data(NAME)["step"])
        settings = translated(rig or {})
        if motors not in (None, count):
            settings.setdefault("motor_count", motors)
        self._known: set[str] = set()
        super().__init__(settings, NAME)
        self._board = Inside(self)

    # the protocol's port, as it is of a SimulatedBoard

    def receive(self, data: bytes) -> None:
        self.protocol.receive(data)

    def transmit(self) -> bytes:
        return super().transmit() if self.protocol is self else self.protocol.transmit()

    def open_port(self, on: bool) -> None:
        self.protocol.open_port(on)

    @property
    def pending(self) -> int:
        return self.protocol.pending

    def edges(self) -> list[Edge]:
        """Return the edges, with a Pico's names of the general outputs."""
        if _shift_ns:
            self.run_until(self.now_ns + _QUEUE_NS)
        found = []
        for time, signal, value in super().edges():
            if signal in self._known or value:
                found.append((time - _shift_ns, _SIGNALS.get(signal, signal), value))
            self._known.add(signal)  # the level that it begins with is no edge
        for number, motor in enumerate(self.rig.motors, 1):
            if motor["servo"]:
                times, levels = self.line_edges(motor["servo"]["pin"])
                for time, level in zip(times.tolist(), levels.tolist(), strict=True):
                    found.append((time - _shift_ns, f"servo{number}", level))
        return found

    def __del__(self) -> None:
        with contextlib.suppress(OSError, AttributeError):
            self.close()


def translated(rig: Mapping[str, Any]) -> dict[str, Any]:
    """Return a rig file with this board's pins."""
    found = dict(rig)
    taken = {limit.get(end) for limit in rig.get("limits", ()) for end in ("high", "low")}
    found["outputs"] = [{"pin": OUTPUTS[pin]} for pin in GENERAL[:2] if pin not in taken]
    found["inputs"] = [{"pin": INPUTS[pin]} for pin in GENERAL[2:] if pin not in taken]
    if "outputs" in rig:
        found["outputs"] = [_moved(item, ("pin",), OUTPUTS) for item in rig["outputs"]]
    if "inputs" in rig:
        found["inputs"] = [_moved(item, ("pin",), INPUTS) for item in rig["inputs"]]
    if "motors" in rig:
        found["motors"] = [
            {**motor, "servo": {"pin": pin, **motor["servo"]}} if "servo" in motor else motor
            for motor, pin in zip(rig["motors"], SERVOS, strict=False)
        ]
    if "limits" in rig:
        found["limits"] = [_moved(item, ("high", "low"), INPUTS) for item in rig["limits"]]
    return found


def _moved(item: Any, keys: tuple[str, ...], pins: Mapping[int, int]) -> Any:
    if not isinstance(item, Mapping):
        return item
    return {key: pins.get(value, value) if key in keys else value for key, value in item.items()}
