"""Boot: board, HAL, controller, run. Settings are in rig.json; `import framestep` is the rest."""

import micropython

# mpremote sends a Ctrl-C as soon as it finds the port, which must not break off the start. The REPL
# sets it again.
micropython.kbd_intr(-1)

import framestep.boot  # noqa: E402

framestep.boot.start()
