"""What differs between the RP2040 and the RP2350: here, as it is on an RP2040.

For an RP2350 the build puts chip_rp2350.py in the place of this module. It folds the constants, so
the difference costs a board nothing. RP2040 datasheet 1.4.3, 2.2, 2.3.1.7, 2.5.3.1, 2.5.7, 2.19.6,
4.6.5, 4.7.
"""

from framestep.base.native import const

# Registers of SIO: addresses, and the same as words from its start
LEVELS = const(0xD0000004)  # of all pins
OUT_SET = const(0xD0000014)  # raises the output pins of a mask
OUT_CLEAR = const(0xD0000018)  # lowers them
DRIVE = const(0xD0000024)  # makes pins outputs
OUT_SET_WORD = const(5)
OUT_CLEAR_WORD = const(6)

# Pins. A page has 4 kB.
IO_PAGE = const(0x40014)  # status and control, a word each for every pin
PADS_PAGE = const(0x4001C)  # one word, then one for every pin
# Bits of a control word: function, and the overrides of output enable and input. The output's
# override is not included, as DMX makes its breaks by it.
CONTROL = const(0x3301F)
OUTOVER = const(8)  # lowest bit of the output's override
MAY_LOSE_PIN = const(1)  # some revisions' USB takes a pin after a bus reset (erratum RP2040-E5)

# A word of the USB controller's memory, behind what the protocol's port keeps there across a soft
# reset: pins that keep their levels then, a bit each
KEPT_PINS = const(0x50100FD8)

# Peripherals
UART0 = const(0x40034000)
UART1 = const(0x40038000)
UART0_REQUEST = const(20)  # for DMA, to send
UART1_REQUEST = const(22)
DMA_CHANNELS = const(12)
DMA_ABORT = const(0x50000444)
DMA_TIMERS = const(0x420)  # from the start of DMA
MICROSECONDS = const(0x40054028)  # a timer's register
WATCHDOG_PAGE = const(0x4005)  # of 64 kB
WATCHDOG_COUNTS = const(2)  # of its counter per microsecond (erratum RP2040-E1)

STACK_TOP = const(0x20042000)
