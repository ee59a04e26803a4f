"""Machine code that runs however little of the stack is left.

MicroPython looks how much of the stack is in use whenever a function is called, and raises
RuntimeError where too little is left. A program on the REPL that calls itself for ever comes to that
point; and an interrupt, or a callback of USB, that comes just then would be ended by the exception,
and not be called again. So what must not end gets a type of its own: a copy of MicroPython's, in
which a call goes to the machine code at once.
"""

from array import array

from machine import mem32

from framestep.native import addressof, const

# mp_obj_type_t: the type's own type, flags and name, twelve numbers of slots, slots. py/obj.h, MicroPython 1.20 to 1.27
_SLOTS = const(5)  # words in front of slot 1
_CODE = const(12)  # of a function: the address of its code (py/objfun.h)
_THUMB = const(1)


def unchecked(*functions):
    """Let viper functions be called without a look at the stack. Those of an unknown make stay as they are."""
    for function in functions:
        at = id(function)
        known = mem32[at]
        slot = mem32[known + 8] >> 16 & 0xFF
        if mem32[known] != id(type) or slot != 1:
            return
        # The garbage collector finds it by the function's first word
        kind = array("I", [mem32[known + 4 * i] for i in range(_SLOTS)] + [mem32[at + _CODE] | _THUMB])
        mem32[at] = addressof(kind)
