"""Where the command `framestep` begins: Ctrl-C ends it without a word also while it is still being
loaded."""

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
