"""Kernels that an image runs from RAM.

The flash cache of an RP2040 has 16 kB, and a pass of the main loop uses more code than that. So
code of each pass and each request has to be fetched from flash again. The kernels named here gain
most for their size (compare `make profile` with and without `--no-cache`); they are copied to RAM
at the start. tools/micropython/in_ram.sh names MicroPython's own functions that run from RAM.
"""

import ast
from collections.abc import Mapping

from .kernels import kernels

# Module; class or ""; function
RAM_FUNCTIONS = (
    ("framestep/hal/rp2/pins.py", "", "levels"),
    ("framestep/hal/rp2/stack.py", "WholeStack", "call"),
    ("framestep/hal/ports/usb_transfers.py", "", "arrived"),
    ("framestep/hal/ports/usb_port.py", "UsbPort", "_transferred"),
    ("framestep/hal/ports/usb_port.py", "UsbPort", "send"),
    ("framestep/hal/ports/usb_port.py", "UsbPort", "glance"),
    ("framestep/pulse/tick.py", "Header", "tick"),
    ("framestep/pulse/stepper.py", "", "poll_flags"),
    ("framestep/pulse/stepper.py", "", "moving"),
    ("framestep/pulse/stepper.py", "", "halt"),
    ("framestep/motors/feeder.py", "", "emptiest_queue"),
)
# If the engine is a stream of words, all kernels of these modules run from RAM: that engine leaves
# less time for planning, and its chip has the memory.
STREAM_MODULES = (
    "framestep/base/",
    "framestep/hal/",
    "framestep/motion/",
    "framestep/motors/",
    "framestep/moves/path/",
    "framestep/moves/run",
    "framestep/moves/upload/chunks",
    "framestep/moves/upload/store",
    "framestep/pulse/",
)


def symbol(source: str, owner: str = "") -> str:
    """Return how MicroPython's freezing names the first machine code of a module or of a class.
    source: "framestep/pulse/tick.py"."""
    plain = source.removesuffix(".py").replace("/", "_")
    file = source.replace("/", "_slash_").replace(".", "_dot_")
    return f"{plain}_{owner}_{file}" if owner else f"{plain}_{file}"


def symbols(modules: Mapping[str, bytes]) -> list[str]:
    """Name the functions as MicroPython's freezing does: "framestep_hal_ports_usb_port_UsbPort_
    framestep_slash_...", numbered within their class.

    modules: {"framestep/hal/ports/usb_port.mpy": source}.

    KeyError: one of them is not there.
    """
    found = {}
    named = {source for source, _, _ in RAM_FUNCTIONS}
    streams = STREAM_MODULES if "framestep/hal/stream.mpy" in modules else ()
    for module, text in modules.items():
        source = module.removesuffix(".mpy").removesuffix(".py") + ".py"
        if source not in named and not source.startswith(streams):
            continue
        numbers: dict[str, int] = {}
        for owner, kernel in kernels(ast.parse(text)):
            number = numbers[owner] = numbers.get(owner, 0) + 1
            name = symbol(source, owner)
            found[source, owner, kernel.name] = name + (str(number) if number > 1 else "")
    wanted = [*RAM_FUNCTIONS, *(key for key in found if key[0].startswith(streams))]
    return list(dict.fromkeys(found[key] for key in wanted))
