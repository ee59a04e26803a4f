"""Code that runs however much of the stack a program on the REPL has taken.

MicroPython looks how much of the stack is in use whenever a function is called, and raises
RuntimeError where more than its limit is. A program that calls itself for ever comes to that point;
and an interrupt, or a callback of USB, that comes just then would be ended by the exception, and
not be called again. So what must not end gets a type of its own: a copy of MicroPython's, in which
a call goes to the machine code at once.

MicroPython's limit leaves 256 bytes, and interrupts take 1000 and more: at the limit they would
write into the end of the heap below the stack, where the uploaded move lies. So the limit becomes
REPL_STACK, and what is called in Python beside the REPL's programs has STACK (WholeStack).
"""

from array import array

from machine import mem32

from framestep.base.native import addressof, const, micropython
from framestep.hal import PASS, REPL_STACK, STACK

# mp_obj_type_t: the type's own type, flags and name, twelve numbers of slots, slots. py/obj.h,
# MicroPython 1.20 to 1.28
_SLOTS = const(5)  # words in front of slot 1
_CODE = const(12)  # of a function: the address of its code (py/objfun.h)
_THUMB = const(1)
# The limit follows the stack's top in MicroPython's state (py/mpstate.h, mp_state_thread_t), in the
# first part of RAM
_RAM = const(0x20000000)
_STATE_ENDS = const(0x20010000)
_TOP_RP2040 = const(0x20042000)
_TOP_RP2350 = const(0x20082000)


@micropython.viper
def _limit_at(at: int) -> int:
    """The address of the limit of the stack; 0 where MicroPython keeps it elsewhere."""
    while at < _STATE_ENDS:
        word = ptr32(at)
        # MicroPython sets it when power comes on, and leaves it alone at a soft reset.
        if word[1] == STACK or word[1] == REPL_STACK:
            if word[0] == _TOP_RP2040 or word[0] == _TOP_RP2350:
                return at + 4
        at += 4
    return 0


class WholeStack:
    """Calls work(x) with the limit of the stack at STACK. Of an unknown make the limit stays as it
    is.

    `callback` is what to call; where the type of `call` is `unchecked` it begins in any case.
    """

    def __init__(self, limit, work, inside):
        """limit: what set_limit() has given back; inside: words of which PASS is 1 meanwhile."""
        self.words = array("i", [limit, addressof(inside)])
        self.work = work
        self.callback = self.call

    @micropython.viper
    def call(self, x):
        words = ptr32(self.words)
        limit = ptr32(words[0])
        inside = ptr32(words[1])
        before = limit[0]
        limit[0] = STACK
        inside[PASS] = 1
        try:
            self.work(x)
        finally:
            inside[PASS] = 0
            limit[0] = before


def set_limit(size):
    """What is called from now on may take that much of the stack: STACK or REPL_STACK. Returns the
    limit's address, or one where nothing lies that counts."""
    at = _limit_at(_RAM)
    if not at:
        return addressof(NOWHERE)
    mem32[at] = size
    return at


NOWHERE = array("i", [0] * (PASS + 1))


def unchecked(*functions):
    """Let viper functions be called without a look at the stack; those of an unknown make stay as
    they are.

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
