"""Boot: board, HAL, controller, run. Settings are in rig.json; `import framestep` is the rest."""

import framestep.boot

framestep.boot.start()
