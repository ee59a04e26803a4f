# This computer, with 32-bit words and with floats that have no more bits than a board's. Addresses are small integers.
ARCH_FLAGS = -m32 -msse2 -mfpmath=sse -fno-pie
PORT_SRC_C = shared/runtime/gchelper_generic.c
LINK = $(CC) $(ARCH_FLAGS) -static -no-pie -Wl,--gc-sections -Wl,-Ttext-segment=$(or $(MEMORY_BASE),0x10000000)
LIBS += -lm # sincosf()
