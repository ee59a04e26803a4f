"""What framestep.base.native has on CPython. Not put on boards."""

from array import array


class micropython:
    """Stands for MicroPython's module: its decorators change nothing here."""

    @staticmethod
    def viper(function):
        return function

    @staticmethod
    def native(function):
        return function


def const(value):
    return value


_memory = {}  # address -> what lies there
_addresses = {}  # id of an array -> its address; arrays stay alive in _memory
_next = [0x1000_0000]


def addressof(memory):
    """Give an array an address that a pointer cast finds it under; the same each time."""
    address = _addresses.get(id(memory))
    if address is None:
        address = _next[0]
        _next[0] += 0x100
        _addresses[id(memory)] = address
        _memory[address] = memory
    return address


map_device = addressof  # anything with __getitem__ and __setitem__ may lie at an address


def forget():
    """Give back the memory of what nobody but the table of addresses holds any more.

    For programs that make many controllers one after the other. Devices must be held by whoever
    mapped them.
    """
    import gc
    import sys
    import weakref

    kept = {}
    for address, memory in _memory.items():
        # bytearrays know no weak references, and refer to nothing themselves
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
    return address


def _pointer(memory):
    return _memory[memory] if memory.__class__ is int else memory


ptr16 = ptr32 = _pointer


def ptr8(memory):
    memory = _pointer(memory)
    return memoryview(memory).cast("B") if memory.__class__ is array else memory
