"""The products of a trace: a VCD file, a picture."""

import io

import numpy as np
import pytest
from vcd.reader import TokenKind, tokenize

from framestep_tools import cli
from framestep_tools.judge.trace import HEADER, Trace
from framestep_tools.judge.vcd import write

EDGES = (
    (5, "enable", 1),
    (5, "dir1", 0),
    (1_000, "enable", 0),
    (10_000, "m1", 1),
    (10_400, "m1", 1),  # sooner than a pulse is long
    (50_000, "dir1", 1),
    (60_000, "m1", -1),
    (60_000, "m12", -1),
)


def changes(content):
    """Return {signal: [(time in ns, value)]} as a reader of VCD files does."""
    names, found, now = {}, {}, None
    for token in tokenize(io.BytesIO(content.encode())):
        if token.kind is TokenKind.TIMESCALE:
            assert (token.timescale.magnitude, token.timescale.unit.value) == (1, "ns")
        elif token.kind is TokenKind.VAR:
            names[token.var.id_code] = token.var.reference
            found[token.var.reference] = []
        elif token.kind is TokenKind.CHANGE_TIME:
            now = token.time_change
        elif token.kind in (TokenKind.CHANGE_SCALAR, TokenKind.CHANGE_VECTOR):
            change = token.data
            found[names[change.id_code]].append((now, change.value))
    return found


def dumped(edges, pulse_ns=1000):
    file = io.StringIO()
    count = write(Trace.from_edges(edges), file, pulse_ns)
    return changes(file.getvalue()), count


def test_a_reader_of_vcd_finds_every_edge():
    found, count = dumped(EDGES)
    assert found["enable"][-2:] == [(5, "1"), (1_000, "0")]
    assert found["dir1"][-2:] == [(5, "0"), (50_000, "1")]
    assert found["step1"][1:] == [
        (10_000, "1"),
        (10_200, "0"),  # half-way to the next
        (10_400, "1"),
        (11_400, "0"),
        (60_000, "1"),
        (61_000, "0"),
    ]
    assert found["position1"][1:] == [(10_000, 1), (10_400, 2), (60_000, 1)]
    minus_one = 2**32 - 1  # two's complement
    assert [value for _, value in found["position12"][1:]] == [minus_one]
    assert count == 4 + 3 * 2 + 3 + 2 + 1


def test_times_never_go_back():
    rng = np.random.default_rng(3)
    edges = [
        (int(at), f"m{motor}", 1)
        for motor in (1, 2, 3)
        for at in np.unique(rng.integers(0, 2_000_000, 4000))
    ]
    found, _ = dumped(edges, 700)
    for motor in (1, 2, 3):
        times = [at for at, _ in found[f"step{motor}"]]
        assert times == sorted(times)
        wanted = sorted(at for at, name, _ in edges if name == f"m{motor}")
        risen = [at for at, level in found[f"step{motor}"][1:] if level == "1"]
        # steps one nanosecond apart leave no room for a low level between them
        assert set(risen) <= set(wanted)
        assert len(risen) > 0.99 * len(wanted)


def test_an_empty_trace_is_an_empty_dump():
    found, count = dumped(())
    assert (found, count) == ({}, 0)


@pytest.fixture
def trace(tmp_path):
    path = tmp_path / "edges.csv"
    rows = sorted(EDGES, key=lambda edge: edge[0])
    path.write_text("\n".join([HEADER, *(f"{t},{s},{v}" for t, s, v in rows)]) + "\n")
    return path


def test_the_command_writes_beside_the_trace(trace, capsys):
    assert cli.app.status(["lab", "vcd", str(trace)]) == 0
    assert capsys.readouterr().out == f"{trace.with_suffix('.vcd')}: 16 changes of 4 signals\n"
    assert changes(trace.with_suffix(".vcd").read_text())["position1"][-1] == (60_000, 1)
    words = ["lab", "vcd", str(trace), "--pulse-us", "0.1", "-o", f"{trace}.v"]
    assert cli.app.status(words) == 0
    assert (10_100, "0") in changes((trace.parent / "edges.csv.v").read_text())["step1"]


@pytest.mark.parametrize("ending", [".png", ".svg"])
def test_a_picture_of_all_signals(trace, ending, capsys):
    picture = trace.with_name(f"picture{ending}")
    assert cli.app.status(["lab", "plot", str(trace), "-o", str(picture)]) == 0
    assert capsys.readouterr().out == f"{picture}\n"
    content = picture.read_bytes()
    if ending == ".png":
        assert content.startswith(b"\x89PNG")
    else:
        for text in (b"motor 12", b"enable", b"dir1", b"velocity"):
            assert b"<!-- " + text in content


@pytest.mark.parametrize(
    ("args", "text"),
    [
        (["lab", "vcd", "/not/there.csv"], "cannot read the trace /not/there.csv: No such file"),
        (["lab", "plot", "/not/there.csv"], "cannot read the trace /not/there.csv: No such file"),
        (["lab", "plot", "{trace}", "-o", "x.txt"], "x.txt: a picture is one of .png, .svg, .pdf"),
        (["lab", "plot", "{empty}"], "empty.csv: nothing has happened in this trace"),
        (["lab", "vcd", "{other}"], "other.csv: expected the header"),
        (["lab", "vcd", "{binary}"],
         "binary.csv: expected a trace, CSV in text, found other bytes"),
        (["lab", "vcd", "{trace}", "-o", "/not/there/x.vcd"],
         "cannot write /not/there/x.vcd: No such"),
    ],
)  # fmt: skip
def test_one_sentence_says_what_is_wrong(args, text, trace, capsys):
    folder = trace.parent
    (folder / "empty.csv").write_text(HEADER + "\n")
    (folder / "other.csv").write_text("frame,1\n0,0\n")
    (folder / "binary.csv").write_bytes(b"\xff\xfe\x00")
    files = {name: folder / f"{name}.csv" for name in ("empty", "other", "binary")}
    assert cli.app.status([arg.format(trace=trace, **files) for arg in args]) == 1
    said = capsys.readouterr().err
    assert text in said
    assert said.count("\n") == 1
