"""What `make flash` does to a board's files: against a board of nothing but files, interrupted at
every single step."""

import json
from hashlib import sha256

import pytest

from framestep_tools.device import DeviceError, Who
from framestep_tools.flash import BOOT, FOLDER, LIST, MAIN, check_firmware, install

OLD = {
    f"{FOLDER}/{name}.mpy": f"old {name}".encode() for name in ("a", "b", "gone", "motion/c")
} | {MAIN: b"old main"}
NEW = {f"{FOLDER}/{name}.mpy": f"new {name}".encode() for name in ("a", "motion/c", "motion/d")} | {
    MAIN: b"new main"
}
NEW[f"{FOLDER}/b.mpy"] = OLD[f"{FOLDER}/b.mpy"]
USERS = {
    "/rig.json": b'{"name": "mine"}',
    "/lib/other.py": b"mine",
    f"{FOLDER}/notes.txt": b"mine",
    "/boot.py": b"",
}


class Unplugged(Exception):
    pass


class FileBoard:
    """Changes count down to the moment at which the cable is pulled; a write may then be half
    done."""

    def __init__(self, files, steps=1000):
        self.content = dict(files)
        self.steps = steps
        self.written = []
        self.damage = None

    def _change(self):
        self.steps -= 1
        if self.steps < 0:
            raise Unplugged

    def files(self, folder):
        return [name for name in self.content if name.startswith(folder + "/")]

    def hashes(self, names):
        return {name: sha256(self.content[name]).digest() for name in names if name in self.content}

    def read(self, name):
        return self.content.get(name)

    def write(self, name, data):
        self.content[name] = data[: len(data) // 2]
        self._change()
        self.content[name] = data if name != self.damage else data + b"?"
        self.written.append(name)

    def replace(self, name, data):
        self.write(name + ".new", data)
        self.rename(name + ".new", name)

    def rename(self, name, new):
        self._change()
        self.content[new] = self.content.pop(name)

    def remove(self, name):
        self._change()
        del self.content[name]

    def restart_and_connect(self):
        self._change()

    def own(self):
        """Everything but a user's files and the list."""
        return {
            n: d
            for n, d in self.content.items()
            if n not in USERS and n != LIST and not n.endswith(".new")
        }


def installed(files=OLD, users=USERS):
    board = FileBoard(users)
    install(board, files, "pico", lambda line: None)
    return board


def test_fresh_board():
    said = []
    board = FileBoard({})
    assert install(board, NEW, "pico", said.append) == len(NEW)
    assert board.own() == NEW
    assert "copying 4/4 /lib/framestep/motion/d.mpy" in said


def test_only_what_changed_is_copied_and_what_is_stale_goes():
    board = installed()
    board.written.clear()
    assert install(board, NEW, "pico", lambda line: None) == 5
    assert board.own() == NEW
    assert {n: board.content[n] for n in USERS} == USERS
    assert sorted(set(board.written) - {LIST, LIST + ".new"}) == [
        f"{FOLDER}/a.mpy",
        f"{FOLDER}/motion/c.mpy",
        f"{FOLDER}/motion/d.mpy",
        MAIN + ".new",
    ]
    board.steps = 0
    assert install(board, NEW, "pico", lambda line: None) == 0, "nothing is changed the second time"


def test_sources_copied_by_hand_do_not_stay_before_the_compiled_ones():
    board = installed(NEW, {**USERS, f"{FOLDER}/a.py": b"by hand"})
    assert f"{FOLDER}/a.py" not in board.content


def test_interrupted_anywhere_the_board_is_never_half_new_and_the_next_run_repairs_it():
    complete, step = False, 0
    while not complete:
        board = installed()
        board.steps = step
        try:
            install(board, NEW, "pico", lambda line: None)
            complete = True
        except Unplugged:
            step += 1
        if MAIN in board.content:
            assert board.own() in (OLD, NEW), f"half new after {step} steps"
        board.steps = 1000
        install(board, NEW, "pico", lambda line: None)
        assert board.own() == NEW, f"after {step} steps"
        assert {n: board.content[n] for n in USERS} == USERS, f"after {step} steps"
        assert sorted(json.loads(board.content[LIST])["files"]) == sorted(NEW)
    assert step >= 10, "there was nothing to interrupt"


def test_another_main_py_is_kept():
    board = FileBoard({MAIN: b"a user's"})
    install(board, NEW, "pico", lambda line: None)
    assert board.content[MAIN] == NEW[MAIN]
    assert board.content["/main_before.py"] == b"a user's"
    board.content[MAIN] = b"changed by the user"
    install(board, NEW, "pico", lambda line: None)
    install(board, OLD, "pico", lambda line: None)
    kept = {name: data for name, data in board.content.items() if "before" in name}
    assert kept == {"/main_before.py": b"a user's", "/main_before_2.py": b"changed by the user"}, (
        "all of a user's, and not framestep's own"
    )


def test_another_boot_py_stays():
    wanted = NEW | {BOOT: b"framestep's"}
    board, said = FileBoard({BOOT: b"a user's"}), []
    install(board, wanted, "pico", said.append)
    install(board, wanted, "pico", said.append)
    assert board.content[BOOT] == b"a user's"
    assert board.content[MAIN] == NEW[MAIN]
    assert said[-1] == f"all {len(NEW)} files are there already"
    assert sum("boot.py is not framestep's" in line for line in said) == 2
    board = FileBoard({})
    for text in (b"framestep's", b"a newer one"):
        install(board, wanted | {BOOT: text}, "pico", said.append)
        assert board.content[BOOT] == text


def test_a_boot_py_that_a_user_has_changed_stays():
    wanted = NEW | {BOOT: b"framestep's"}
    board, said = FileBoard({}), []
    install(board, wanted, "pico", lambda line: None)
    board.content[BOOT] = b"changed by the user"
    for newer in (wanted, OLD | {BOOT: b"a newer one"}, wanted):
        install(board, newer, "pico", said.append)
        assert board.content[BOOT] == b"changed by the user"
        assert board.content[MAIN] == newer[MAIN]
    assert sum("boot.py is not framestep's" in line for line in said) == 3
    del board.content[BOOT]
    install(board, wanted, "pico", lambda line: None)
    assert board.content[BOOT] == b"framestep's"
    board.content[BOOT] = b"framestep's" + b"changed again"
    install(board, wanted, "pico", lambda line: None)
    assert board.content[BOOT] == b"framestep'schanged again"


def test_a_boot_py_of_which_no_hash_is_listed_is_kept():
    """The list of an earlier framestep: it may be that one's, or a user's."""
    board = FileBoard({BOOT: b"whose?", LIST: json.dumps({"files": [BOOT], "main": ""}).encode()})
    install(board, NEW | {BOOT: b"framestep's"}, "pico", lambda line: None)
    assert board.content[BOOT] == b"framestep's"
    assert board.content["/boot_before.py"] == b"whose?"


def test_interrupted_anywhere_boot_py_is_whole_and_framesteps():
    complete, step = False, 0
    while not complete:
        board = installed(OLD | {BOOT: b"older one"}, {})
        board.steps = step
        try:
            install(board, NEW | {BOOT: b"newer one"}, "pico", lambda line: None)
            complete = True
        except Unplugged:
            step += 1
        assert board.content[BOOT] in (b"older one", b"newer one"), f"after {step} steps"
        board.steps = 1000
        install(board, NEW | {BOOT: b"newest one"}, "pico", lambda line: None)
        assert board.content[BOOT] == b"newest one", f"after {step} steps"
        assert "/boot_before.py" not in board.content


def test_damage_on_the_way_is_noticed():
    board = FileBoard({})
    board.damage = f"{FOLDER}/a.mpy"
    with pytest.raises(DeviceError, match=r"/lib/framestep/a.mpy did not arrive"):
        install(board, NEW, "pico", lambda line: None)
    assert MAIN not in board.content


PICO = Who(
    "rp2",
    (1, 26, 1),
    4 << 10 | 3 << 8 | 6,
    "Raspberry Pi Pico with RP2040",
    True,
    "/lib/framestep/__init__.mpy",
)


def test_firmware_that_fits():
    check_firmware(PICO, "pico")
    check_firmware(PICO._replace(version=(1, 29, 0), framestep=""), "pico")


@pytest.mark.parametrize(
    ("what", "text"),
    [
        ({"version": (1, 25, 0)}, "has MicroPython 1.25.0: hold BOOTSEL"),
        (
            {"mpy": 7 << 10 | 3 << 8 | 6, "machine": "Pico 2"},
            "is for armv7emsp, Raspberry Pi Pico needs armv6m",
        ),
        ({"platform": "esp32"}, "this one says esp32: name its port with --port"),
        ({"mpy": 4 << 10 | 7}, "does not know this form of .mpy files"),
        ({"second_port": False}, "does not know a second USB port"),
        ({"framestep": "framestep/__init__.py"}, "framestep is part of this board's firmware"),
    ],
)
def test_firmware_that_does_not_fit(what, text):
    with pytest.raises(DeviceError, match=text) as error:
        check_firmware(PICO._replace(**what), "pico")
    assert "micropython.org/download/RPI_PICO/" in str(error.value) or "platform" in what
    assert "\n" not in str(error.value)
