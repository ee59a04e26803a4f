"""mpremote next to a running framestep: what it transfers arrives whatever happens to the rig."""

import subprocess
import sys

from framestep_emulator import Emulator
from framestep_tools.building import images

ESTOP = 19
RIG = b'{"estop": "nc"}'


def test_files_arrive_while_the_estop_is_pressed(tmp_path):
    data = bytes(range(256)) * 24
    (tmp_path / "sent").write_bytes(data)
    with Emulator(images.frozen(), files={"/rig.json": RIG}, lockstep=False, speed=1) as emulator:
        emulator.set_pin(ESTOP, 0)
        emulator.wait_usb(10_000, ports=2)
        with emulator.pty(0) as path:
            command = [sys.executable, "-m", "mpremote", "connect", path, "resume"]
            for copy in ("sent :a", "sent :b", ":a back"):
                with subprocess.Popen(
                    [*command, "cp", *copy.split()],
                    cwd=tmp_path,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    text=True,
                ) as running:
                    presses = 0
                    while running.poll() is None:
                        emulator.set_pin(ESTOP, 1)
                        emulator.advance(150)
                        emulator.set_pin(ESTOP, 0)
                        emulator.advance(100)
                        presses += 1
                    assert running.returncode == 0, f"{copy}: {running.stdout.read()}"
                    assert presses > 2
    assert (tmp_path / "back").read_bytes() == data


def test_a_folder_is_mounted_without_framestep(chip, tmp_path):
    """As docs/use/repl.md says: next to framestep there is too little memory for it. The clock is
    the chip's own then."""
    (tmp_path / "hello.py").write_text("print('mounted', 6 * 7)\n")
    with chip.emulator(lockstep=False, speed=1) as emulator:
        emulator.press_bootsel()
        before = emulator.ns
        emulator.reset()
        emulator.wait_usb(10_000, ports=1, after=before)
        emulator.press_bootsel(False)
        assert emulator.cycles()["hz"] == chip.slow_mhz * 1e6
        with emulator.pty(0) as path:
            command = [sys.executable, "-m", "mpremote", "connect", path, "resume", "mount", "."]
            command += ["exec", "import hello"]
            done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert "mounted 42" in done.stdout, done.stdout + done.stderr
