"""The checks, a module for each subject."""

from . import framing, lengths, motors, numbers, runs, uploads

SUBJECTS = (framing, lengths, numbers, motors, uploads, runs)
