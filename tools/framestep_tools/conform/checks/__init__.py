"""The checks, a module for each subject."""

from ..kit import Check
from . import (
    arms,
    couples,
    edges,
    framing,
    inputs,
    lengths,
    lights,
    loops,
    motors,
    numbers,
    ramps,
    rolls,
    runs,
    shoot,
    uploads,
    virtuals,
)

SUBJECTS = (
    framing,
    lengths,
    numbers,
    motors,
    ramps,
    uploads,
    runs,
    rolls,
    loops,
    shoot,
    virtuals,
    arms,
    couples,
    edges,
    lights,
    inputs,
)


def every_check() -> list[Check]:
    """Return all checks by subject, in the order in which they run."""
    return [check for subject in SUBJECTS for check in subject.CHECKS]
