"""Lets code run however much of the stack a program on the REPL has taken.

MicroPython checks the stack whenever a function is called, and raises RuntimeError if more than its
limit is in use. A program with endless recursion gets to that point. If an interrupt or a callback
of USB came just then, the exception would end it, and it would not be called again. So a function
that must not end gets a type of its own: a copy of MicroPython's, in which a call goes directly to
the machine code.

MicroPython's limit leaves 256 bytes, but interrupts take 1000 and more: at the limit they would
write into the end of the heap below the stack, where the uploaded move is. So the limit is lowered
to REPL_STACK, and Python code that is called while a REPL program runs has STACK (WholeStack).
"""

from array import array

from machine import mem32

from framestep.base.clock import WIDE_WRAP
from framestep.base.native import addressof, const, micropython
from framestep.hal import PASS, REPL_STACK, STACK
from framestep.hal.rp2 import chip
from framestep.pulse.stepper import CLOCK, PASSES, SKIP, SPENT

# mp_obj_type_t: the type's own type, flags and name, twelve numbers of slots, slots. py/obj.h,
# MicroPython 1.20 to 1.28
_SLOTS = const(5)  # words before slot 1
_CODE = const(12)  # of a function: the address of its code (py/objfun.h)
_THUMB = const(1)
# The limit follows the stack's top in MicroPython's state (py/mpstate.h, mp_state_thread_t), in the
# first part of RAM
_RAM = const(0x20000000)
_STATE_ENDS = const(0x20010000)


@micropython.viper
def _limit_at(at: int) -> int:
    """Return the address of the stack's limit, or 0 if MicroPython keeps it elsewhere."""
    while at < _STATE_ENDS:
        word = ptr32(at)
        # MicroPython sets it at power-up, and leaves it alone at a soft reset.
        if word[1] == STACK or word[1] == REPL_STACK:
            if word[0] == chip.STACK_TOP:
                return at + 4
        at += 4
    return 0


class WholeStack:
    """Calls work(x) with the stack's limit at STACK. With an unknown MicroPython the limit does not
    change.

    `callback` is the function to call. If the type of `call` is `unchecked`, it always begins.
    """

    def __init__(self, limit, work, inside, header=0):
        """limit: result of set_limit(); inside: words; PASS is 1 during the call. header: address
        of the kernel's words; the time of the calls, without ticks, is added to its PASSES."""
        self.words = array("i", [limit, addressof(inside), header])
        self.work = work
        self.callback = self.call

    @micropython.viper
    def call(self, x):
        words = ptr32(self.words)
        limit = ptr32(words[0])
        inside = ptr32(words[1])
        header = words[2]
        if header:
            h = ptr32(header)
            if h[SKIP] > 1:
                h[SKIP] = h[SKIP] - 1
                return
        before = limit[0]
        limit[0] = STACK
        inside[PASS] = 1
        begun = 0
        if header:
            h = ptr32(header)
            begun = ptr32(h[CLOCK])[0] - h[SPENT]
        try:
            self.work(x)
        finally:
            if header:
                h = ptr32(header)
                h[PASSES] = (ptr32(h[CLOCK])[0] - h[SPENT] - begun + h[PASSES]) & WIDE_WRAP
            inside[PASS] = 0
            limit[0] = before


def set_limit(size):
    """Set how much of the stack code may take from now on: STACK or REPL_STACK. Return the limit's
    address, or the address of NOWHERE."""
    at = _limit_at(_RAM)
    if not at:
        return addressof(NOWHERE)
    mem32[at] = size
    return at


NOWHERE = array("i", [0] * (PASS + 1))


def unchecked(*functions):
    """Let viper functions be called without a check of the stack. Functions of an unknown kind do
    not change.

    Return their types, which must be kept as long as the functions are.
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
