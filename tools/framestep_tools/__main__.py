"""Entry of the command `framestep`. Ctrl-C ends it silently, even while it is still loading."""

import signal
import sys


def main() -> None:
    """Run the command line and exit."""
    handler = signal.signal(signal.SIGINT, signal.SIG_DFL)
    from .cli import app

    signal.signal(signal.SIGINT, handler)
    sys.exit(app.status())


if __name__ == "__main__":
    main()
