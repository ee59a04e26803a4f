"""The checks, a module for each subject."""

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
