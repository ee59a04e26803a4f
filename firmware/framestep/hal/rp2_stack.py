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
    """Let viper functions be called without a look at the stack; those of an unknown make stay as they are.

    Returns their types, which must be kept as long as the functions are.
    """
    known = mem32[id(functions[0])]
    if mem32[known] != id(type) or (mem32[known + 8] >> 16) & 0xFF != 1:
        return None
    alike = [function for function in functions if mem32[id(function)] == known]
    kinds = array("I", bytearray(4 * (_SLOTS + 1) * len(alike)))
    at = addressof(kinds)
    for function in alike:
        for i in range(_SLOTS):
            mem32[at + 4 * i] = mem32[known + 4 * i]
        mem32[at + 4 * _SLOTS] = mem32[id(function) + _CODE] | _THUMB
        mem32[id(function)] = at
        at += 4 * (_SLOTS + 1)
    return kinds
