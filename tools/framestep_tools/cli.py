"""The command `framestep`: talk to a motion controller from a shell.

A device is named by its path (/dev/ttyACM1) or as socket://HOST:PORT. The controller stops its motors when its host
leaves, so a command that moves something waits until it stands.
"""

from .commands import motors, moves, rig, traffic, virtual
from .errors import Command

app = Command("framestep", help=__doc__, no_args_is_help=False)
for _subject in (motors, virtual, moves, traffic, rig):
    _subject.add(app)

if __name__ == "__main__":
    app()
