"""Scripts for the REPL of a board that gets framestep into its file system, for the page that
installs framestep. Their result comes after \\x02, as JSON.
"""

from ..board import file_install

WHO = """
import json, sys
i = sys.implementation
print("\\x02")
print(json.dumps([list(i.version[:2]), i._mpy >> 10, i._machine]))
"""
# Whether main.py is another one, which would run instead of framestep
OTHER_MAIN = f"""
print("\\x02")
try:
    with open({file_install.MAIN!r}, "rb") as file:
        print(0 if {file_install.OURS!r} in file.read() else 1)
except OSError: print(0)
"""
# A line for each file of framestep
LIST = f"""
import json, os
def walk(folder):
    for name, kind, *_ in os.ilistdir(folder):
        path = folder + "/" + name
        if kind & 0x4000: walk(path)
        else: print(json.dumps(path))
print("\\x02")
try: walk({file_install.PLACE.folder!r})
except OSError: pass
"""
# digest(path) prints the SHA-256 of a file, null if there is none
DIGEST = """
import hashlib, json
from binascii import hexlify
def digest(path):
    h = hashlib.sha256()
    b = bytearray(512)
    try: f = open(path, "rb")
    except OSError:
        print("null")
        return
    while n := f.readinto(b): h.update(memoryview(b)[:n])
    f.close()
    print(json.dumps(hexlify(h.digest()).decode()))
"""
# folder(path) makes a folder; w(text) writes base64 to the file f
WRITE = """
import os
from binascii import a2b_base64
def folder(path):
    try: os.mkdir(path)
    except OSError as e:
        if e.errno != 17: raise
def w(text): f.write(a2b_base64(text))
"""

FOR_THE_PAGE = {
    "who": WHO,
    "otherMain": OTHER_MAIN,
    "list": LIST,
    "digest": DIGEST,
    "write": WRITE,
}
