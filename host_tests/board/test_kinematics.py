"""The kinematics of the virtual axes as machine code of the RP2040: the same bits as on CPython, in
less than a millisecond."""

from framestep_tools.bench.virtual_cost import virtual_update_us
from framestep_tools.bench.virtual_precision import RIGS
from framestep_tools.building.board_files import compiled_tree
from host_tests.runtime.test_virtuals import REPLAY, expected, script


def test_bits_and_cost(emulator):
    repl = emulator(
        put={str(compiled_tree("armv6m")): "/lib"}, files={"/replay.py": REPLAY.read_bytes()}
    ).repl()
    repl.exec("from replay import play")
    for rig in RIGS.values():
        lines = script(rig, 8)
        assert repl.exec(f"play({lines})", timeout=60).splitlines() == expected(lines)
    assert virtual_update_us(repl.exec) < 1000
