"""The checks, a module for each subject."""

from ..kit import Check
from .arms import ARMS
from .couples import COUPLES
from .edges import EDGES
from .framing import FRAMING
from .inputs import INPUTS
from .lengths import LENGTHS
from .lights import LIGHTS
from .loops import LOOPS
from .motors import MOTORS
from .numbers import NUMBERS
from .ramps import RAMPS
from .rolls import ROLLS
from .runs import RUNS
from .shoot import SHOOT
from .uploads import UPLOADS
from .virtuals import VIRTUALS

SUBJECTS = (
    FRAMING,
    LENGTHS,
    NUMBERS,
    MOTORS,
    RAMPS,
    UPLOADS,
    RUNS,
    ROLLS,
    LOOPS,
    SHOOT,
    VIRTUALS,
    ARMS,
    COUPLES,
    EDGES,
    LIGHTS,
    INPUTS,
)


def every_check() -> list[Check]:
    """Return all checks by subject, in the order in which they run."""
    return [check for subject in SUBJECTS for check in subject.checks]
