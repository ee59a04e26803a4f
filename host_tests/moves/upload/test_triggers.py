"""The store of triggers; test_light_levels.py compares both stores with dictionaries."""

from host_tests.moves.upload.lightplots import answers, triggers


def test_triggers_in_any_order_and_again():
    answered = answers(
        *(
            "NEW 3000",
            "BEGIN 10",
            triggers(1, [(9, 1), (3, 2**32 - 1)]),
            triggers(2**31, [(0, 5), (9, 2), (9, 4)]),
        ),
        *("FINISH", "TRIGGERS -1 10", "HAS"),
    )
    assert answered[-2:] == ["-2147483648 0:5 3:-1 9:4", "0 0 1"]
