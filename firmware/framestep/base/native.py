"""One source for the kernels on every runtime.

On MicroPython `@micropython.viper` compiles a function to machine code and `ptr8/16/32` are casts
that the compiler knows. On CPython the same source runs as plain Python: the decorators return the
function unchanged. A pointer is the array itself or, for an address, the array registered under it.

Rules for a kernel, so that all runtimes compute the same numbers:

* Every value fits 32 bits signed, unless `& mask` cuts it at once. The caller splits a product that
  does not fit. A line in which a sum may wrap ends in `# wraps`. host_tests.machine_code checks it.
* Memory is `array('i')` (ptr32), `array('h')` (ptr16) or `bytearray` (ptr8), never a slice of one.
  A cast to ptr8 gives the bytes of any of them.
* A pointer into an array is made from `addressof(array)`, which a state word keeps.
"""

# ruff: noqa: F401 - other modules import these names from here

try:
    import micropython
    from micropython import const
    from uctypes import addressof

    CPYTHON = False
    # The viper compiler replaces these names; binding them makes `from native import ptr32` work.
    ptr8 = ptr16 = ptr32 = None

    def as_word(address):
        """Return an address as the signed 32-bit number that fits a state word."""
        return address - 0x1_0000_0000 if address & 0x8000_0000 else address

except ImportError:
    from framestep.base.native_cpython import (  # type: ignore[assignment, no-redef]
        addressof,
        as_word,
        const,
        micropython,
        ptr8,
        ptr16,
        ptr32,
    )

    CPYTHON = True
