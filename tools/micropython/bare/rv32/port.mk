# ESP32-C3 and C6, and the RISC-V cores of the RP2350.
CROSS_COMPILE ?= riscv64-unknown-elf-
# GCC 12 has its libraries for rv32imac without Zicsr; in the older ISA, I includes its instructions
ARCH_FLAGS = -march=rv32imac -mabi=ilp32 -misa-spec=2.2
SPECS = --specs=picolibc.specs
PORT_SRC_O = rv32/start.o shared/runtime/gchelper_native.o shared/runtime/gchelper_rv32i.o
LINK = $(CC) $(ARCH_FLAGS) $(SPECS) -nostartfiles -Wl,--gc-sections -Wl,--no-warn-rwx-segments \
	-T rv32/link.ld $(if $(MEMORY_BASE),-Wl,--defsym=memory_base=$(MEMORY_BASE))
