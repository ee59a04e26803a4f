"""The constants of chip.py as they are on an RP2350.

RP2350 datasheet 2.2, 3.1.11, 9.11, 12.6, 12.8.5, 12.9.
"""

from framestep.base.native import const

# Registers of SIO: addresses, and the same as words from its start
LEVELS = const(0xD0000004)  # of all pins
OUT_SET = const(0xD0000018)  # raises the output pins of a mask
OUT_CLEAR = const(0xD0000020)  # lowers them
DRIVE = const(0xD0000038)  # makes pins outputs
OUT_SET_WORD = const(6)
OUT_CLEAR_WORD = const(8)

# Pins. A page has 4 kB.
IO_PAGE = const(0x40028)  # status and control, a word each for every pin
PADS_PAGE = const(0x40038)  # one word, then one for every pin
# Bits of a control word: function, and the overrides of output enable and input. The output's
# override is not included, as DMX makes its breaks by it.
CONTROL = const(0x3C01F)
OUTOVER = const(12)  # lowest bit of the output's override
MAY_LOSE_PIN = const(0)  # some revisions' USB takes a pin after a bus reset (erratum RP2040-E5)

# A word of the USB controller's memory, behind what the protocol's port keeps there across a soft
# reset: pins that keep their levels then, a bit each
KEPT_PINS = const(0x50100FD8)

# Peripherals
UART0 = const(0x40070000)
UART1 = const(0x40078000)
UART0_REQUEST = const(28)  # for DMA, to send
UART1_REQUEST = const(30)
DMA_CHANNELS = const(16)
DMA_ABORT = const(0x50000464)
DMA_TIMERS = const(0x440)  # from the start of DMA
MICROSECONDS = const(0x400B0028)  # a timer's register
WATCHDOG_PAGE = const(0x400D)  # of 64 kB
WATCHDOG_COUNTS = const(1)  # of its counter per microsecond (erratum RP2040-E1)

STACK_TOP = const(0x20082000)
