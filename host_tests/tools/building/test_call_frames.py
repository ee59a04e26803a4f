"""Sizes of call frames in the compiled firmware."""

from framestep_tools.building.board_files import board_modules, compiled
from host_tests.mpy_file import BYTECODE, parse


def test_frames_of_what_runs_while_the_heap_is_not_locked():
    """Frames of more than eleven words come from the heap (VM_MAX_STATE_ON_STACK in py/objfun.c).
    With no memory left, MicroPython collects for each: 30 ms, in which no pass begins."""
    source = b"def f(a, b):\n  try:\n    return [a, b, [a, b, [a, b]]]\n  finally:\n    a.x\n"
    _, body = parse(compiled("frame.py", source, "armv6m"))
    assert body.children[0].frame_words == 2 + 9 + 3
    names, body = parse(board_modules()["framestep/runner.mpy"])
    words = {
        names[each.name_index]: each.frame_words
        for each in body.walk()
        if each.kind == BYTECODE and each.name_index < len(names)
    }
    assert max(words[name] for name in ("_pass", "_poll", "_blink")) <= 11 < words["_turn"]
