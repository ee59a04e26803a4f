"""CPython's version of what framestep.base.native exports. Not put on boards."""

from array import array


class micropython:
    """Stand-in for MicroPython's module: its decorator returns the function unchanged."""

    @staticmethod
    def viper(function):
        return function


def const(value):
    return value


_memory = {}  # address -> the object at that address
_addresses = {}  # id of an object -> its address; _memory keeps the objects alive
_next = [0x1000_0000]


def addressof(memory):
    """Return the address at which a pointer cast finds `memory`; the same on each call."""
    address = _addresses.get(id(memory))
    if address is None:
        address = _next[0]
        _next[0] += 0x100
        _addresses[id(memory)] = address
        _memory[address] = memory
    return address


map_device = addressof  # anything with __getitem__ and __setitem__ can have an address


def forget():
    """Free the memory to which only the table of addresses still refers.

    For programs that make many controllers one after the other. Whoever mapped a device must hold
    a reference to it.
    """
    import gc
    import sys
    import weakref

    kept = {}
    for address, memory in _memory.items():
        # A bytearray allows no weak references, and refers to no other object.
        kept[address] = memory if memory.__class__ is bytearray else weakref.ref(memory)
    _memory.clear()
    memory = None
    gc.collect()
    while kept:
        address, memory = kept.popitem()
        if memory.__class__ is weakref.ref:
            memory = memory()
        elif sys.getrefcount(memory) == 2:  # `memory` here, and the argument
            memory = None
        if memory is not None:
            _memory[address] = memory
    _addresses.clear()
    _addresses.update((id(memory), address) for address, memory in _memory.items())


def as_word(address):
    return address - 0x1_0000_0000 if address & 0x8000_0000 else address


def _pointer(memory):
    return _memory[memory] if memory.__class__ is int else memory


ptr16 = ptr32 = _pointer


def ptr8(memory):
    memory = _pointer(memory)
    return memoryview(memory).cast("B") if memory.__class__ is array else memory
