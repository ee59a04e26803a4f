"""One source for the kernels on every runtime.

On MicroPython `@micropython.viper` compiles a function to machine code and `ptr8/16/32` are casts
that the compiler knows. On CPython the same source runs as plain Python: the decorators hand the
function back, and a pointer is the array itself or, for an address, the array registered under it.

Rules for a kernel, so that the runtimes agree number by number:

* every value fits 32 bits signed, but for what `& mask` cuts off at once; a product that does not
  is split by the caller. A line in which a sum may come round ends in `# wraps`.
  host_tests.int32 holds tests to this;
* memory is `array('i')` (ptr32), `array('h')` (ptr16) or `bytearray` (ptr8), never a slice of one;
  a cast to ptr8 gives the bytes of any;
* a pointer to a part of an array is made with `addressof(array)` kept in a state word.
"""

# ruff: noqa: F401 - what is imported here is imported from here

try:
    import micropython
    from micropython import const
    from uctypes import addressof

    CPYTHON = False
    # Names the viper compiler replaces; bound here so that the import below works everywhere.
    ptr8 = ptr16 = ptr32 = None

    def as_word(address):
        """An address as the signed 32-bit number that fits a state word."""
        return address - 0x1_0000_0000 if address & 0x8000_0000 else address

except ImportError:
    from framestep.base.native_cpython import (
        addressof,
        as_word,
        const,
        micropython,
        ptr8,
        ptr16,
        ptr32,
    )

    CPYTHON = True
