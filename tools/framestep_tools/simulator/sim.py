"""The controller in the foreground, on this computer: `make sim`, which is `framestep sim`."""

from ..commands.sim import sim
from ..errors import Command

app = Command("sim")
app.command()(sim)

if __name__ == "__main__":
    app()
