"""Profile of the processor's cycles, by Python function and by function of the firmware."""

import bisect
import subprocess
from collections import defaultdict
from dataclasses import dataclass

_ENTRANCES = ("fun_viper_call", "fun_native_call", "fun_asm_call")  # called with the function
_STATES = ("mp_execute_bytecode",)  # called with a code state


class Symbols:
    """Names of the addresses of a firmware, from its ELF file."""

    def __init__(self, elf):
        lines = subprocess.run(
            ["arm-none-eabi-nm", "-n", elf], capture_output=True, text=True, check=True
        ).stdout
        found = [line.split() for line in lines.splitlines()]
        pairs = [(int(f[0], 16), f[2]) for f in found if len(f) == 3 and not f[2].startswith("$")]
        self.addresses = [address for address, _ in pairs]
        self.names = [name for _, name in pairs]

    def find(self, names):
        """Return the addresses of these names, as far as they exist."""
        return [a for a, name in zip(self.addresses, self.names, strict=True) if name in names]

    def name(self, address):
        """Return the symbol that contains an address."""
        return self.names[max(0, bisect.bisect_right(self.addresses, address) - 1)]


@dataclass
class Function:
    """A Python function: its name or address, calls, its own time and the time including what it
    calls, µs.

    Own time includes what MicroPython does for the function: looking up names, calling.
    """

    name: str
    calls: int
    own_us: float
    inner_us: float


class Profile:
    """Profiles the board within its context: profile = Profile(emulator, elf); with profile: ...

    `elf`: the firmware that the board runs, for the names. Afterwards `functions` has the Python
    functions, those with the most time of their own first, `firmware` µs by symbol, `ms` the
    duration.
    """

    def __init__(self, emulator, elf):
        self.symbols = Symbols(elf)
        self.ms = 0.0
        self.functions = []
        self.firmware = {}
        self._emulator = emulator

    def __enter__(self):
        entrances, states = self.symbols.find(_ENTRANCES), self.symbols.find(_STATES)
        self._emulator.cmd("profile", on=True, entrances=entrances, states=states)
        self.ms = -self._emulator.ns / 1e6
        return self

    def __exit__(self, *_):
        self.ms += self._emulator.ns / 1e6
        found = self._emulator.cmd("profile", on=False)
        per_us = self._emulator.cycles()["hz"] / 1e6
        spent = defaultdict(float)
        for address, cycles in found["addresses"]:
            spent[self.symbols.name(address)] += cycles / per_us
        self.firmware = dict(sorted(spent.items(), key=lambda item: -item[1]))
        for code, calls, own, inner in sorted(found["functions"], key=lambda row: -row[2]):
            # code that is not frozen is in the heap, where there are no symbols
            name = self.symbols.name(code) if code >> 28 == 1 else hex(code)
            self.functions.append(Function(name, calls, own / per_us, inner / per_us))
