"""An operator at the rig who presses its switches when asked."""

from collections.abc import Callable


class Operator:
    """Asks somebody to press switches.

    say: shows a sentence and waits until the operator confirms; ask: returns a yes or no.
    """

    slow = True

    def __init__(self, say: Callable[[str], None], ask: Callable[[str], bool]):
        self.say, self.ask = say, ask
        self._has: dict[str, bool] = {}
        self._ready = ""

    def has(self, what: str) -> bool:
        """Return whether the rig has a switch. Each is asked for once."""
        if what not in self._has:
            self._has[what] = self.ask(f"Is there a switch to press for the {what}?")
        return self._has[what]

    def ready(self, what: str) -> None:
        """Announce that a switch has to be pressed during the next motion."""
        self.say(
            f"Motor 1 will move slowly. As soon as it does, press the {what} and hold it "
            "until you are asked to let go. Enter begins"
        )
        self._ready = what

    def press(self, what: str, on: bool) -> None:
        """Have a switch pressed, unless ready() has announced it, or released."""
        if on and self._ready == what:
            return
        self._ready = ""
        self.say(f"{'Press' if on else 'Let go of'} the {what}{', hold it' * on}; then Enter")
