"""What can go wrong."""


class EmulatorError(Exception):
    """The emulator did not do what it was asked to; the text says what and why."""


class ReplError(Exception):
    """An exception on the board; args[0] is its traceback."""
