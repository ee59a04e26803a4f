"""`make sim`, which is `framestep sim`: the controller on this computer, in the foreground."""

from ..commands.sim import sim
from ..errors import Command

app = Command("sim")
app.command()(sim)

if __name__ == "__main__":
    app()
