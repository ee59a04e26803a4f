"""Kernels that an image runs from RAM.

The flash cache of an RP2040 has 16 kB, which a pass of the main loop goes through more than once:
what each pass and each request calls has to be fetched from flash anew. The kernels named here,
those that gain most for their size, are copied to RAM at the start (`make profile` with and without
`--no-cache` tells). MicroPython's functions that run from RAM are named in
tools/micropython/in_ram.sh.
"""

import ast
from collections.abc import Iterator, Mapping

# Module; class or ""; function
RAM_FUNCTIONS = (
    ("framestep/hal/rp2_pins.py", "", "levels"),
    ("framestep/hal/rp2_stack.py", "WholeStack", "call"),
    ("framestep/hal/rp2_pulses.py", "", "lost_commands"),
    ("framestep/hal/usb_transfers.py", "", "arrived"),
    ("framestep/hal/usb_port.py", "UsbPort", "send"),
    ("framestep/motion/tick.py", "Header", "tick"),
    ("framestep/motion/stepper.py", "", "awaiting_target"),
    ("framestep/motion/stepper.py", "", "poll_flags"),
    ("framestep/motion/stepper.py", "", "moving"),
    ("framestep/motors/feeder.py", "", "neediest"),
)


def _kernels(body: list[ast.stmt], owner: str = "") -> Iterator[tuple[str, str]]:
    """(class or "", function) of what is compiled to machine code, in the order of the text."""
    for node in body:
        if isinstance(node, ast.ClassDef):
            yield from _kernels(node.body, node.name)
        elif isinstance(node, ast.If):  # both ways are compiled
            yield from _kernels([*node.body, *node.orelse], owner)
        elif isinstance(node, ast.FunctionDef):
            kinds = {d.attr for d in node.decorator_list if isinstance(d, ast.Attribute)}
            if kinds & {"viper", "native"}:
                yield owner, node.name


def symbols(modules: Mapping[str, bytes]) -> list[str]:
    """What MicroPython's freezing calls RAM_FUNCTIONS in {"framestep/hal/usb_port.mpy": source}.

    "framestep_hal_usb_port_UsbPort_framestep_slash_...", numbered within their class.

    KeyError: one of them is not there.
    """
    found = {}
    for module, text in modules.items():
        source = module.removesuffix(".mpy").removesuffix(".py") + ".py"
        plain = source.removesuffix(".py").replace("/", "_")
        file = source.replace("/", "_slash_").replace(".", "_dot_")
        numbers: dict[str, int] = {}
        for owner, name in _kernels(ast.parse(text).body):
            number = numbers[owner] = numbers.get(owner, 0) + 1
            within = f"{plain}_{owner}_" if owner else f"{plain}_"
            found[source, owner, name] = within + file + (str(number) if number > 1 else "")
    return [found[wanted] for wanted in RAM_FUNCTIONS]
