"""On which frame of the uploaded move the motors are, and what keeps them from going elsewhere.

Nothing here moves a motor, and nothing allocates.
"""

from framestep.base.results import (
    ERR_GENERAL,
    ERR_HARD_LOW,
    ERR_HARD_UP,
    ERR_RANGE,
    ERR_SOFT_LOW,
    ERR_SOFT_UP,
    OK,
)
from framestep.motors import bounds
from framestep.moves.path.move_check import BATCH
from framestep.moves.upload.store import READY as UPLOADED


def all_at(axes, bits, positions, directions):
    """Return whether all motors of these bits are at rest on positions[motor], with their backlash
    taken up for directions[motor]."""
    motor = 0
    while bits >> motor:
        if (bits >> motor) & 1 and not axes[motor].rests_on(positions, motor, directions[motor]):
            return False
        motor += 1
    return True


def all_on_frame(player, bits, index):
    """Return whether all motors of these bits that have uploaded positions are at rest on the
    frame `index`."""
    store = player.store
    position = player.position
    for motor in range(player.count):
        if (bits >> motor) & 1 and store.has(motor):
            store.position(motor, index, position, 0)
            if not player.axes[motor].rests_on(position, 0):
                return False
    return True


def find_frame(player, bits, near):
    """Return the index of a frame on which all motors are, or -1. `near` is tried first."""
    store = player.store
    if not bits:
        return -1
    last = store.end - store.start
    if 0 <= near <= last and all_on_frame(player, bits, near):
        return near
    motor = 0
    while not (bits >> motor) & 1:
        motor += 1
    axis = player.axes[motor]
    values = player.values
    index = 0
    while index <= last:
        count = min(last + 1 - index, BATCH)
        store.positions(motor, index, count, values, 0)
        for i in range(count):
            if axis.rests_on(values, i) and all_on_frame(player, bits, index + i):
                return index + i
        index += count
    return -1


def find_positions(player, safety, frame, among, positions):
    """positions[motor] = position at a scene frame, for the motors of the bits `among`.

    Return OK, or why they cannot go there.
    """
    store = player.store
    if store.state != UPLOADED:
        return ERR_GENERAL
    if frame < store.start or frame > store.end:
        return ERR_RANGE
    bits = player.motors() & among
    for motor in range(player.count):
        if (bits >> motor) & 1:
            player.axes.hal.port.look_for_stop()
            store.position(motor, frame - store.start, positions, motor)
            side = bounds.outside(player.axes[motor], positions, motor)
            if side:
                return ERR_SOFT_UP if side > 0 else ERR_SOFT_LOW
    return find_blocking_switch(player, safety, bits, positions)


def find_blocking_switch(player, safety, bits, positions):
    """Return OK, or the code of a limit switch that blocks a motor's way to positions[motor]."""
    for motor in range(player.count):
        if (bits >> motor) & 1:
            player.axes.hal.port.look_for_stop()
            code = safety.limit_blocking(motor, positions, motor)
            if code != OK:
                return code
    return OK


def find_switch_on_path(player, safety, bits, at, to, positions):
    """Return OK, or the code of a limit switch that blocks a motor's way from index `at` to `to`.

    positions: scratch, a word for each motor.
    """
    step = 1 if to > at else -1
    for motor in range(player.count):
        if (bits >> motor) & 1 and safety.active_limits(motor):
            axis = player.axes[motor]
            index = at
            while index != to:
                index += step
                player.store.position(motor, index, positions, motor)
                if not axis.rests_on(positions, motor):
                    # the first frame with another position shows in which direction it goes
                    code = safety.limit_blocking(motor, positions, motor)
                    if code != OK:
                        return code
                    break
    return OK


def find_switch_ahead(player, safety, operation):
    """Return OK, or the code of an active limit switch toward which a motor would start."""
    if safety.active:
        for motor in range(player.count):
            if (operation.bits >> motor) & 1:
                ends = safety.active_limits(motor)
                direction = operation.heading(motor) if ends else 0
                if direction > 0 and ends & 1:
                    return ERR_HARD_UP
                if direction < 0 and ends & 2:
                    return ERR_HARD_LOW
    return OK
