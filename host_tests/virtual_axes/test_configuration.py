"""VIRT_CONFIG: which payloads are accepted or refused, and the pose that it reports (note 9.2)."""

import math
from array import array
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from framestep.motion import reals
from framestep.protocol import messages
from framestep.virtual_axes.kinematics import kinematics
from framestep.virtual_axes.registers import SAFE, WRIST_EW
from framestep_tools.judge.virtual_reference import Axis, Rig
from framestep_tools.move.kinematics import Firmware, Refused
from host_tests.virtual_axes.test_kinematics import HEAD, near

FULL = {
    1: Rig(
        1, (Axis(1), Axis(2), Axis(3), *HEAD), 500, 100, (1, 2, 3), tuple(range(-600, 610, 10)), 50
    ),
    2: Rig(2, (Axis(1), Axis(2))),
    3: Rig(3, (Axis(1), Axis(2), Axis(3), *HEAD), 500, 100, (1, 2, 3), safe=50),
    4: Rig(4, (Axis(1), Axis(2), Axis(3), *HEAD), nodal=(1, 2, 3), safe=50),
}


def word(payload, at, value):
    return payload[:at] + value.to_bytes(4, "little", signed=True) + payload[at + 4 :]


KEPT = WRIST_EW  # registers below this one are kept from one request to another


@pytest.mark.parametrize("kind", [1, 2, 3, 4])
def test_refused_configurations_change_nothing(kind):
    firmware = Firmware.of(FULL[kind])
    payload = FULL[kind].payload()
    stride = 8 if kind == 2 else 12

    def held():
        table = firmware.geometry.table.tolist() if kind == 1 else None
        return (
            firmware.r[:KEPT].tolist(),
            bytes(firmware.geometry.motor),
            firmware.geometry.start.tolist(),
            table,
        )

    before = held()
    bad = [
        word(payload, 1, 9), word(payload, 1, -1), word(payload, 1, 2**31 - 1),
        word(payload, 1 + stride, 1), word(payload, 5, 0),
    ]  # fmt: skip
    if kind in (1, 3):
        bad += [word(payload, 73, -100_000)]
    if kind == 1:
        bad += [
            word(payload, 73, 0),
            word(payload, 93, 10),
            word(payload, 93 + 480, 590),
            word(payload, 93 + 240, 10),
        ]
    if kind == 2:
        bad += [word(payload, 1, 0)]
    for changed in bad:
        with pytest.raises(Refused, match=str(messages.ERR_RANGE)):
            firmware.configure(changed)
        assert held() == before
    for length in range(1, LEAST[kind]):
        with pytest.raises(Refused, match=str(messages.ERR_RANGE)):
            firmware.configure(payload[:length])
    assert held() == before


LEAST = {1: 93, 2: 17, 3: 93, 4: 85}


@pytest.mark.parametrize("kind", [1, 2, 3, 4])
def test_what_follows_is_ignored(kind):
    """Field note 1.8: after the last optional field that is present. The boom table is present from
    484 bytes on (9.2)."""
    bare = Rig(
        kind, FULL[kind].axes, FULL[kind].length, FULL[kind].extension, FULL[kind].nodal
    ).payload()
    assert len(bare) == LEAST[kind]
    for safe in (None, 123.25) if kind != 2 else (None,):
        for table in (None, FULL[1].table) if kind == 1 else (None,):
            rig = Rig(
                kind, FULL[kind].axes, FULL[kind].length, FULL[kind].extension, FULL[kind].nodal,
                table, safe,
            )  # fmt: skip
            payload = rig.payload()
            # too short for the next optional field, or any length after the last one
            room = 485 if safe is not None and table is None and kind == 1 else 900
            most = 3 if safe is None and kind != 2 else room - len(payload) + len(bare) - 2
            for more in {0, 1, 2, 3, min(4, most), most // 2, most}:
                firmware = Firmware(kind)
                firmware.configure(payload + b"\xfe" * more)
                assert reals.value(firmware.r, SAFE) == (safe or 0)
                wanted = Firmware(kind)
                wanted.configure(payload)
                assert firmware.r[:KEPT] == wanted.r[:KEPT]
                assert firmware.geometry.motor == wanted.geometry.motor
                if kind == 1:
                    assert firmware.geometry.table == wanted.geometry.table
                    assert firmware.geometry._has_table == (table is not None)


@given(
    st.integers(-(2**31), 2**31 - 1),
    st.integers(2**29, 2**30 - 1),
    st.sampled_from([1, -1]),
    st.integers(-40, 6),
)
@example(2**31 - 1, 2**29, 1, -29)
@example(-(2**31), 2**29, 1, 2)
@example(2**31 - 1, 2**30 - 1, -1, 2)
def test_what_is_reported_is_held_within_32_bits(reported, mantissa, sign, exponent):
    firmware = Firmware(4)
    firmware.geometry.host_pose[0] = reported
    firmware.r[0], firmware.r[1] = sign * mantissa, exponent
    out = array("i", [0])
    kinematics._sum_to_word(out, 0, firmware.r, 0, firmware.geometry.host_pose, 0)
    exact = reported + math.floor(
        Fraction(sign * mantissa) * Fraction(2) ** exponent + Fraction(1, 2)
    )
    assert out[0] == min(max(exact, -(2**31)), 2**31 - 1)


@pytest.mark.parametrize("kind", [1, 2, 3, 4])
def test_all_positions_0_read_0(kind):
    """Whatever the reach of the boom, the nodal offset and the steps at which the motors are."""
    for steps in (
        (0,) * 6,
        (12_345, -54_321, 2**30, 77_777, -8_888, 9_999),
        (-(2**31), 5, 2**31 - 1, 6, 7, 8),
    ):
        axes = tuple(Axis(i + 1, 1000, 0.0, steps[i]) for i in range(2 if kind == 2 else 6))
        if kind == 2 and any(steps):
            continue  # it has no positions: see test_swing_pan
        rig = Rig(kind, axes, 857.7, 78.0, (20.0, 35.5, -12.0))
        assert Firmware.of(rig).host_pose() == [0] * 6


@pytest.mark.parametrize("kind", [1, 3, 4])
def test_the_pose_reported_is_that_of_the_message(kind):
    """To its last digit; a target is relative to it."""
    reported = (8.25, -19999.99999, 0.00001, -10.5, 3.25, 21474.83647)
    order = {1: (2, 1, 0, 3, 4, 5), 3: (2, 1, 0, 3, 4, 5), 4: (1, 2, 0, 3, 4, 5)}[kind]
    axes = tuple(Axis(i + 1, 250, reported[k], 5000 * i) for i, k in enumerate(order))
    rig = Rig(kind, axes, 857.7, 78.0, (20.0, 35.5, -12.0))
    firmware = Firmware.of(rig)
    assert firmware.host_pose() == list(reported)
    steps = {1: 2500, 2: 4000, 3: 10_700, 4: 15_500, 5: 21_000, 6: 24_000}
    firmware.locate(steps)
    joints = rig.joints(list(steps.values()))
    near(firmware.host_pose(), rig.host_pose(rig.forward(joints)), 1e-4)
    near(rig.from_host(rig.host_pose(rig.forward(joints))), rig.forward(joints), 1e-9)


def test_many_turns_before_the_configuration_cost_no_precision():
    axes = tuple(
        Axis(i + 1, 1000, 0.0, s)
        for i, s in enumerate((0, 2**30 + 360_007, 2**30, -(2**30), 2**30, -(2**30)))
    )
    rig = Rig(1, axes, 857.7, 78.0, (20.0, 35.5, -12.0))
    firmware = Firmware.of(rig)
    pose = rig.forward(rig.home)
    pose[1] -= 100
    firmware.inverse(pose)
    near(
        np.array(firmware.steps()) - [a.step for a in axes],
        rig.steps(rig.inverse(pose, rig.home)) - [a.step for a in axes],
        2,
    )
