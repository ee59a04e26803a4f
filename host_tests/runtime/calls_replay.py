"""Runs on MicroPython and on CPython: calls of functions of numbers and memory, with the heap
locked.

Lines on standard input: module, name and arguments, which are numbers, or memory in hex after its
type: b bytes, w words; `=0`: the memory of argument 0. The answer: the result, and the
memory afterwards.
"""

import sys
from array import array
from binascii import hexlify

try:
    from micropython import heap_lock, heap_unlock
except ImportError:

    def heap_lock():
        pass

    heap_unlock = heap_lock


def argument(text, before):
    if text[0] == "=":
        return before[int(text[1:])]
    if text[0] in "bw":
        data = bytes.fromhex(text[1:])
        return bytearray(data) if text[0] == "b" else array("i", data)
    return int(text)


def call(function, a):
    """Call without an allocation, so not by function(*a)."""
    count = len(a)
    heap_lock()
    try:
        if count == 1:
            return function(a[0])
        if count == 3:
            return function(a[0], a[1], a[2])
        if count == 5:
            return function(a[0], a[1], a[2], a[3], a[4])
        return function(a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7])
    finally:
        heap_unlock()


def answer(line):
    module, name, *words = line.split()
    function = getattr(__import__(module, None, None, (name,)), name)
    arguments = []
    for word in words:
        arguments.append(argument(word, arguments))
    found = [str(call(function, arguments))]
    found += [hexlify(bytes(a)).decode() for a in arguments if not isinstance(a, int)]
    return " ".join(found)


if __name__ == "__main__":
    for line in sys.stdin:
        print(answer(line))
