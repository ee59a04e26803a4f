"""The kernels of protocol and upload store as code for the RP2040's processor, with the heap
locked."""

from pathlib import Path

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from host_tests.board.modules import board_modules
from host_tests.moves.upload import uploads
from host_tests.protocol import streams

RUNTIME = Path(__file__).parents[1] / "runtime"
MODULES = (
    "__init__ base/__init__ base/native base/copying base/results"
    " protocol/__init__ protocol/messages protocol/checksum protocol/frames"
    " moves/__init__ moves/upload/__init__ moves/upload/chunks moves/upload/codec"
    " moves/upload/store"
)
ONCE = {"deadline": None, "phases": [Phase.generate], "suppress_health_check": list(HealthCheck)}


def run(emulator, module, call, lines):
    """Return what a script of the runtime layer answers on the board to these lines."""
    files = board_modules(MODULES.split())
    files |= {f"/{module}.py": (RUNTIME / f"{module}.py").read_bytes(), "/lines": "".join(lines)}
    repl = emulator(files=files).repl()
    return (
        repl.exec(f"import {module}\nwith open('/lines') as lines:\n    {call}\n", timeout=60)
        .replace("\r", "")
        .split("\n")
    )


@given(st.lists(streams.cases(), min_size=15, max_size=15))
@settings(max_examples=3, **ONCE)
def test_any_stream_in_any_pieces(emulator, cases):
    answers = run(
        emulator, "frames_echo", "frames_echo.main(lines)", [case.line() for case in cases]
    )
    assert len(answers) == len(cases) + 1
    for case, answer in zip(cases, answers, strict=False):
        assert answer == streams.expected(case).hex(), case


@given(st.lists(uploads.uploads(steps=12, memories=(380, 700, 1100)), min_size=4, max_size=4))
@settings(max_examples=3, **ONCE)
def test_any_upload(emulator, scripts):
    script = [step for script in scripts for step in script]
    call = "for answer in store_replay.replay(line.strip() for line in lines): print(answer)"
    answers = run(emulator, "store_replay", call, [line + "\n" for line, _ in script])
    assert len(answers) == len(script) + 1
    for (line, step), answer, wanted in zip(
        script, answers, uploads.expected(script), strict=False
    ):
        assert answer == wanted, (line[:60], step[:4])
