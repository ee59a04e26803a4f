"""Session scripts: what happens to a board from its start, as text. script_player.py
plays them.

    # what the script shows
    board pico                    of boards/, fitted to the rig; "host" for hal.host.BOARD
    target rp2350                 what plays it (fuzz/chip_player.py); by default the host
    rig {"hard_stop_factor": 2}   content of the rig file; text that is not JSON is a truncated file
    motors 3                      how many, whatever the board has
    memory 4096                   bytes for the uploaded move
    flash 0 5a00ff                first bytes of a block of the flash for positions; "flash none":
                                  no flash
    0 open                        the host opens the port (DTR), likewise close
    12 rx 4446…                   bytes from the host
    12 pin estop 0                an input's level, by its name or its number
    12 hold 40                    the main loop is away: for 40 ms there are ticks, but no pass
    12 skip 3                     interrupts are off: three ticks are missed and made up for later;
                                  no passes either
    12 prompt                     questions that have come are answered before the pass
    12 full                       the host takes no more bytes, until drain
    12 repl gc.collect()          a line for the REPL of an emulated chip, if there was a `repl` in
                                  millisecond 0; without a line: Ctrl-C
    500 end

Times are whole milliseconds of the board's clock, ascending. In a millisecond its events come
first, in the order of the lines; then its tick, then one pass of the main loop. Millisecond 0 is
the first.

Nothing here imports the core: fuzz.py does when its kernels have become machine code.
"""

import json

VERBS = ("open", "close", "rx", "pin", "hold", "skip", "full", "drain", "prompt", "repl")
_NUMBERS = ("hold", "skip")


class ScriptError(ValueError):
    """A line that does not belong to a script; the text names it."""


class Script:
    """A script in parts. rig: a dictionary, or None if the file cannot be read. events: [(ms, verb,
    argument)]; argument: bytes for rx, (name, level) for pin, milliseconds for hold and skip, text
    for repl, else None. memory: bytes or None; flash: {block: bytes}, or None without a flash.
    says: the comment lines at the top."""

    def __init__(self, board="host", rig=None):
        self.says = []
        self.board = board
        self.target = "host"
        self.rig = {} if rig is None else rig
        self.rig_text = None  # the file's text if it is not JSON
        self.motors = None
        self.memory = None
        self.flash = {}
        self.events = []
        self.end = 0

    def lines(self):
        """Return the text, line by line."""
        for text in self.says:
            yield "# " + text
        yield "board " + self.board
        if self.target != "host":
            yield "target " + self.target
        yield "rig " + (json.dumps(self.rig) if self.rig is not None else self.rig_text or "{")
        if self.motors:
            yield f"motors {self.motors}"
        if self.memory is not None:
            yield f"memory {self.memory}"
        if self.flash is None:
            yield "flash none"
        else:
            for block in self.flash:
                yield f"flash {block} {bytes(self.flash[block]).hex()}"
        for ms, verb, argument in self.events:
            if verb == "rx":
                argument = bytes(argument).hex()
            elif verb == "pin":
                argument = f"{argument[0]} {argument[1]}"
            yield f"{ms} {verb}" if argument is None else f"{ms} {verb} {argument}"
        yield f"{self.end} end"


def event(line):
    """Return (ms, verb, argument) of a line with an event; "end" is one, too."""
    parts = line.split()
    try:
        ms = int(parts[0])
        verb = parts[1]
        argument = None
        if verb == "rx":
            argument = bytes.fromhex(parts[2])
        elif verb == "pin":
            argument = (int(parts[2]) if parts[2].isdigit() else parts[2], int(parts[3]))
        elif verb == "repl":
            argument = line.split(None, 2)[2].strip() if len(parts) > 2 else ""
        elif verb in _NUMBERS:
            argument = int(parts[2])
        elif verb != "end" and verb not in VERBS:
            raise ValueError
    except (ValueError, IndexError):
        raise ScriptError("not a line of a session script: " + line) from None
    return ms, verb, argument


def _header(script, word, rest):
    if word == "board":
        script.board = rest
    elif word == "target":
        script.target = rest
    elif word == "rig":
        try:
            script.rig = json.loads(rest)
        except ValueError:
            script.rig, script.rig_text = None, rest
    elif word == "motors":
        script.motors = int(rest)
    elif word == "memory":
        script.memory = int(rest)
    elif word == "flash":
        if rest == "none":
            script.flash = None
        else:
            block, content = rest.split(" ", 1)
            script.flash[int(block)] = bytes.fromhex(content)
    else:
        return False
    return True


def parse(lines):
    """Return the Script in these lines, for example a file. Raises ScriptError."""
    script = Script()
    for line in lines:
        line = line.strip()
        if line.startswith("#"):
            if not script.events:
                script.says.append(line[1:].strip())
            continue
        if not line:
            continue
        word, _, rest = line.partition(" ")
        if _header(script, word, rest):
            continue
        ms, verb, argument = event(line)
        if script.events and ms < script.events[-1][0]:
            raise ScriptError("earlier than the line before: " + line)
        if verb == "end":
            script.end = ms
            return script
        script.events.append((ms, verb, argument))
    script.end = script.events[-1][0] if script.events else 0
    return script
