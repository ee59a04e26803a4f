# ESP32, ESP32-S2 and S3: registers in windows. compile.py replaces Espressif's compiler.
CROSS_COMPILE = xtensa-lx106-elf-
CC = $(PYTHON) $(abspath xtensa/compile.py)
PORT_INC = -Ixtensa/include
PORT_CFLAGS = -Wno-error
PORT_SRC_C = xtensa/arithmetic.c shared/libc/string0.c
PORT_SRC_O = xtensa/start.o
LINK = xtensa-lx106-elf-ld --gc-sections --no-relax --no-warn-rwx-segments -T xtensa/link.ld
