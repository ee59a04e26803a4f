"""Tests that `make check` runs."""

from host_tests.near import distances, importers, nearest


def test_imports_are_found_in_each_way_of_writing_them():
    by = importers()
    assert "firmware/framestep/motors/axis.py" in by["firmware/framestep/motors/backlash.py"]
    assert (
        "tools/framestep_tools/simulator/boards.py" in by["tools/framestep_tools/errors.py"]
    )  # relative
    assert "host_tests/near.py" in by["tools/framestep_tools/building/board_files.py"]
    assert "tools/framestep_emulator/__init__.py" in by["tools/framestep_emulator/emulator.py"]


def test_tests_named_after_a_change_come_first_then_the_nearest():
    tests = nearest({"firmware/framestep/motors/backlash.py"})
    assert set(tests[:2]) == {
        "host_tests/end_to_end/motors/test_backlash.py",
        "host_tests/motors/test_backlash.py",
    }
    far = distances({"firmware/framestep/motors/backlash.py"})
    steps = [far[test] for test in tests[2:]]
    assert steps == sorted(steps)
    assert "host_tests/protocol/test_messages.py" in tests  # by the controller


def test_what_a_change_does_not_reach_is_left_out():
    tests = nearest({"tools/framestep_tools/judge/vcd.py"})
    assert tests
    assert "host_tests/motion/test_ramps.py" not in tests


def test_a_file_of_another_kind_is_reached_by_those_who_name_it():
    assert "host_tests/project/test_setup.py" in nearest({"tools/setup.sh"})
    nobody = "nobody" + "-names-it.bin"
    assert nearest({nobody}) == []
