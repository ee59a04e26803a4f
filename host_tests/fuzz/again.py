"""A session again, on 32-bit MicroPython: byte by byte and cue by cue as on CPython, with the heap
locked in every tick and pass and never fuller than before, while all counters wrap."""

import tempfile
from pathlib import Path
from random import Random

import pytest

from host_tests.recording import REPLAY, differences, recorded, wrapping_at
from host_tests.runtimes import Runtime
from host_tests.script import Script

from .findings import Finding
from .trial import Trial

_WEIGH_MS = 1000
_INTO_A_RUN_MS = 2048


class Again:
    """Plays trials again. replay: what plays a recording."""

    def __init__(self, replay: Path = REPLAY):
        self._folder = tempfile.TemporaryDirectory()
        self._path = Path(self._folder.name) / "session.recording"
        self._runtime = Runtime("x86", self._path.parent)
        self._replay = replay

    def trial(self, script: Script) -> Trial:
        """Return a Trial that judge() can play again."""
        with recorded(weigh_ms=_WEIGH_MS) as recorders:
            trial = Trial(script)
        (trial.player.recorder,) = recorders
        return trial

    def judge(self, trial: Trial) -> None:
        """Play a trial again. Finding if it differs."""
        recording = trial.player.recorder.finish()
        moment = Random(trial.ms).choice(trial.runs.goes or [trial.ms // 2])
        wraps = wrapping_at(moment + _INTO_A_RUN_MS)
        try:
            found = differences(self._runtime, recording, self._path, wraps, self._replay)
        except pytest.fail.Exception as error:
            found = str(error)[-1000:]
        if found:
            raise Finding("again", f"at {trial.ms} ms, on 32-bit MicroPython:\n{found}")
