"""Scripts for the board's REPL, for the console with and without its server. A page that has the
REPL's port itself gets them in protocol.js.

Their result comes after the last \\x02 of their output. A `text` is in the variable of that name on
the board.
"""

from ..board.repl_device import RIG_FILE, STATE, STOP

LOAD = """
import framestep.repl
print("\\x02")
framestep.repl.timing()
"""
LIVE_BEGIN = "from framestep.repl.figures import live\n"
LIVE = """
print("\\x02")
live()
"""
# Drops the functions and modules of LIVE_BEGIN
LIVE_END = """
from framestep.boot import forget
del live
forget("framestep.repl.figures", "framestep.repl.commands")
del forget
"""
# A line of JSON for each piece; nothing if there is no file
READ = f"""
import json
print("\\x02")
try:
    with open({RIG_FILE!r}) as file:
        while True:
            piece = file.read(256)
            if not piece: break
            print(json.dumps(piece))
except OSError: pass
"""
# A line of JSON: [valid, or null if the board lacks the memory to check; the mistake or a greeting]
CHECK = """
import json
from framestep.boot import judge
print("\\x02")
print(json.dumps(judge(text)))
"""
# 1: motors move, or are about to; nothing has been stopped
HALT = (
    STATE
    + """
print("\\x02")
"""
    + STOP
)
# Frees the memory of a framestep that getting to the REPL has ended, on a board that restarts later
FREE = """
import gc, sys
b = sys.modules.get("framestep.boot")
if b and b.controller:
    b.runner.stop()
    b.controller = b.runner = b.hal = None
gc.collect()
"""
# Replaced in one step at the end: it is the old file or the new one. 1: it arrived as sent
WRITE = f"""
print("\\x02")
import os
with open("{RIG_FILE}.new", "w") as file: file.write(text)
with open("{RIG_FILE}.new") as file: right = file.read() == text
if right: os.rename("{RIG_FILE}.new", "{RIG_FILE}")
print(1 if right else 0)
"""
REMOVE = f"import os\nos.remove({RIG_FILE!r})\n"
RESTART = "import machine\nmachine.reset()\n"

FOR_THE_PAGE = {
    "load": LOAD,
    "live_begin": LIVE_BEGIN,
    "live": LIVE,
    "live_end": LIVE_END,
    "read": READ,
    "check": CHECK,
    "halt": HALT,
    "free": FREE,
    "write": WRITE,
    "remove": REMOVE,
    "restart": RESTART,
}
