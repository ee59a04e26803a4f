"""Switches and inputs of a simulated board, for their tests."""

from framestep_tools.payloads import (
    GioIn,
)

VELOCITY, ACCELERATION = 5000, 20000  # field note 4.1


SWITCHES = {"limits": [{"high": 22, "low": 26}, {"high": 27, "low": 28, "contact": "no"}]}


def inputs(session):
    return session.ask(GioIn()).levels


def set_input(session, name, level):
    session.board._board.set_input(name, level)


def calm(session, estop=False):
    """Close the switches, so that no input is active."""
    for pin in (22, 26):
        set_input(session, pin, 0)
    if estop:
        set_input(session, "estop", 0)
    session.run(0.05)
    session.forget()
