# What MicroPython's own makefiles need to know of the chip before they are included.
MICROPY_VFS_LFS2 = 1
