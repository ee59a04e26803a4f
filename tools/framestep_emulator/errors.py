"""Errors of the emulator and of the emulated board."""


class EmulatorError(Exception):
    """The emulator could not carry out a call; the text explains it."""


class ReplError(Exception):
    """An exception on the board; args[0] is its traceback."""
