"""`framestep stream`: packets of FreeD and OSC, byte for byte, and over UDP on this computer."""

import signal
import socket
import struct

import pytest

from framestep_tools import cli
from framestep_tools.axes.axes_file import Axis
from framestep_tools.axes.rig_axes import Axes
from framestep_tools.client.client import Event
from framestep_tools.client.live_positions import (
    FreeD,
    LiveError,
    Pose,
    Stream,
    Target,
    freed,
    osc,
    osc_bundle,
    osc_message,
)
from framestep_tools.commands.common import talking
from framestep_tools.payloads import Positions, VirtConfig, VirtMove, VirtPositions, VirtualAxis
from framestep_tools.simulator.boards import SimulatedBoard
from host_tests.tools.client.test_open_port import PATIENCE_S, begun
from host_tests.tools.simulator.test_serve import serving, tcp_url

AXES = Axes(
    [
        Axis("pan", 2, 100.0, "deg", invert=True),
        Axis("track", 1, 10.0, "cm", zero=5.0),
        Axis("focus ring", 4, 1.0, "steps"),
        Axis("Zoom", 5, 2.0, "units"),
    ],
    "axes.toml",
)


def decoded(packet):
    """Return pan, tilt, roll in degrees, X, Y, height in mm, zoom and focus: by the manual."""
    assert (len(packet), packet[0]) == (29, 0xD1)
    assert (sum(packet) & 0xFF) == 0x40
    numbers = [int.from_bytes(packet[i : i + 3], "big", signed=i < 20) for i in range(2, 26, 3)]
    return [n / 32768 for n in numbers[:3]] + [n / 64 for n in numbers[3:6]] + numbers[6:]


def test_freed_by_hand():
    packet = freed(Pose(1.5, 2.0, -3.0, pan=-90, tilt=45, roll=-0.5), 4095, 7, camera=3)
    assert packet.hex() == (
        "d103" "2d0000" "168000" "ffc000" "000060" "0000c0" "000080" "000fff" "000007" "0000" "35"
    )  # fmt: skip
    assert decoded(packet) == [90, 45, -0.5, 1.5, 3, 2, 4095, 7]


def test_freeds_ends():
    """The manual's own: -180 degrees is A60000, -131072 mm is 800000, the highest is 7FFFFF."""
    packet = freed(Pose(x=-200_000, y=200_000, pan=180), zoom=-5, focus=2**31)
    assert packet[2:5].hex() == "a60000"
    assert packet[11:14].hex() == "800000"
    assert packet[17:20].hex() == "7fffff"
    assert packet[20:26].hex() == "000000ffffff"
    assert decoded(freed(Pose(pan=-270, tilt=365, roll=-190)))[:3] == [-90, 5, 170]


def test_osc_of_its_specification():
    assert osc_message("/oscillator/4/frequency", 440.0) == (
        b"/oscillator/4/frequency\0,f\0\0\x43\xdc\0\0"
    )
    assert osc_message("/foo", 1000, -1, 1.234) == (
        b"/foo\0\0\0\0,iif\0\0\0\0\0\0\x03\xe8\xff\xff\xff\xff\x3f\x9d\xf3\xb6"
    )
    message = osc_message("/a", 1)
    assert osc_bundle([message]) == b"#bundle\0" + bytes(7) + b"\x01\0\0\0\x0c" + message


def parsed(packet):
    """Return {address: values} of a bundle."""
    found, at = {}, 16
    assert packet[:16] == b"#bundle\0" + bytes(7) + b"\x01"
    while at < len(packet):
        (size,) = struct.unpack_from(">i", packet, at)
        message = packet[at + 4 : at + 4 + size]
        address = message[: message.index(0)].decode()
        comma = len(address) + 4 - len(address) % 4
        types = message[comma + 1 : message.index(0, comma)].decode()
        start = comma + (len(types) + 1) + 4 - (len(types) + 1) % 4
        found[address] = struct.unpack(f">{types}", message[start:])
        at += 4 + size
    return found


def test_units_of_axes_and_steps_of_other_motors():
    report = Positions(2500, (120, 300, -7, 9, 11))
    assert parsed(osc(AXES, report, None)) == {
        "/framestep/frame": (2.5,), "/framestep/axis/track": (17.0,),
        "/framestep/axis/pan": (-3.0,), "/framestep/motor/3": (-7,),
        "/framestep/axis/focus%20ring": (9.0,), "/framestep/axis/Zoom": (5.5,),
    }  # fmt: skip
    pose = VirtPositions(300_000, 100_000, 200_000, 4_000_000, 500_000, 600_000)
    assert parsed(osc(AXES, report, pose))["/framestep/camera"] == (1, 2, 3, 40, 5, 6)


def test_freed_takes_virtual_axes_or_else_named_axes():
    output = FreeD(AXES, None, 1)
    report = Positions(0, (120, 300, -7, 9, 11))
    assert decoded(output.packet(report, None)) == [3, 0, 0, 0, -170, 0, 11, 0]
    assert decoded(output.packet(Positions(0, (120,)), None)) == [0, 0, 0, 0, -170, 0, 0, 0]
    pose = VirtPositions(300_000, 100_000, 200_000, 4_000_000, 500_000, 600_000)
    assert decoded(output.packet(report, pose)) == [-40, 5, 6, 10, -30, 20, 11, 0]
    assert decoded(FreeD(AXES, "mm", 1).packet(report, pose))[3:6] == [1, -3, 2]
    assert decoded(FreeD(Axes(), None, 1).packet(report, pose))[3:6] == [1, -3, 2]
    assert FreeD(Axes(), None, 1).packet(report, None) is None


class Kept:
    """A target that keeps what it gets."""

    def __init__(self):
        self.got = []

    def send(self, packet):
        self.got.append(packet)


def test_each_report_is_one_packet_with_the_pose_of_its_moment():
    target = Kept()
    first, pose = Positions(0, (0,)), VirtPositions(0, 0, 0, 0, 0, 0)

    def pair(report, pose):
        return report.steps[0], pose and pose.track

    live = Stream([(target, pair)], first, None)
    sent = [
        Positions(0, (1,)),  # without virtual axes
        Positions(0, (2,)),
        VirtPositions(9, 0, 0, 0, 0, 0),  # just configured
        Positions(0, (3,)),
        VirtPositions(8, 0, 0, 0, 0, 0),
        Positions(0, (4,)),  # just removed
        Positions(0, (5,)),
        Positions(0, (6,)),
    ]
    for message in sent:
        live.hear(Event(0.0, message))
    assert target.got == [(1, None), (2, None), (2, 9), (3, 8), (5, None), (6, None)]
    target.got.clear()
    Stream([(target, pair)], first, pose).send()
    assert target.got == [(0, 0)]


def test_what_cannot_be_sent_is_dropped_and_counted():
    target = Target("--osc", "127.0.0.1:9")
    target.send(bytes(70_000))  # no datagram is as long
    target.send(b"x")
    target.close()
    assert (target.dropped, target.why) == (1, "Message too long")


@pytest.mark.parametrize(
    "address", ["", "host", "127.0.0.1:", ":5000", "127.0.0.1:0", "127.0.0.1:65536", "h:1:x", "h:²"]
)
def test_a_wrong_address_is_a_sentence(address, capsys):
    assert cli.app.status(["stream", "--osc", address]) == 2
    said = capsys.readouterr().err
    assert "--osc: expected HOST:PORT such as 192.168.1.20:40000, found" in said
    assert len(said.splitlines()) == 1


def test_mistakes_are_sentences(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def said(*words):
        assert cli.app.status(["stream", *words]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        return line

    assert "name where to send: --freed HOST:PORT, --osc HOST:PORT or both" in said()
    assert "--unit: 'deg' is not one of mm, cm" in said("--freed", "127.0.0.1:9", "--unit", "deg")
    assert "there is no host" in said("--freed", "no host.invalid:9")
    with pytest.raises(LiveError, match="expected axis tilt in a unit such as deg, found steps"):
        FreeD(Axes([Axis("tilt", 1, 1.0, "steps")]), None, 1)
    mixed = [Axis("x", 1, 1.0, "mm"), Axis("y", 2, 1.0, "m")]
    with pytest.raises(LiveError, match="has lengths in m and mm: name the unit of virtual axes"):
        FreeD(Axes(mixed), None, 1)
    FreeD(Axes(mixed), "cm", 1)


@pytest.fixture
def board():
    """Return the address of a simulated board."""
    with serving(SimulatedBoard(), tcp="127.0.0.1:0") as server:
        yield tcp_url(server)


class Receiver:
    """A program that listens on this computer."""

    def __init__(self):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(PATIENCE_S)
        self.address = f"127.0.0.1:{self.socket.getsockname()[1]}"

    def until(self, condition):
        """Return the packets up to the first one for which a condition is true."""
        found = [self.socket.recv(65536)]
        while not condition(found[-1]):
            found.append(self.socket.recv(65536))
        return found


def test_a_move_of_a_second_program_is_followed(board, tmp_path, monkeypatch):
    """At rest positions come again. Virtual axes may be configured later."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "axes.toml").write_text(
        '[[axis]]\nname = "x"\nmotor = 1\nunit = "mm"\nsteps_per_unit = 100\n'
    )
    lens, camera = Receiver(), Receiver()
    live = begun("stream", board, "--osc", lens.address, "--freed", camera.address)
    try:
        at_rest = lens.until(lambda packet: True)[0]
        assert parsed(at_rest)["/framestep/axis/x"] == (0.0,)
        assert lens.until(lambda packet: True) == [at_rest]
        assert cli.app.status(["move", board, "1", "20mm"]) == 0
        under_way = lens.until(lambda packet: parsed(packet)["/framestep/axis/x"] == (20.0,))
        places = [parsed(packet)["/framestep/axis/x"][0] for packet in under_way]
        assert len(set(places)) > 3
        assert places == sorted(places)
        camera.until(lambda packet: decoded(packet)[3] == 20)
        axes = tuple(VirtualAxis(motor, 100_000) for motor in range(1, 7))
        with talking(board) as client:  # through the program that has the port
            client.request(VirtConfig(4, axes, (0, 0, 0)))
            client.request(VirtMove(4, 500_000))
            client.wait_idle()
        camera.until(lambda packet: decoded(packet)[0] == -5)
        found = lens.until(lambda packet: "/framestep/camera" in parsed(packet))[-1]
        assert parsed(found)["/framestep/camera"][:3] == (0, 0, 0)
    finally:
        live.send_signal(signal.SIGINT)
        said = live.communicate(timeout=PATIENCE_S)[1]
    assert said == f"sending to {camera.address} and {lens.address}; Ctrl-C ends it\n"
    assert live.returncode == 0


def test_no_pose_is_a_sentence(board, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.app.status(["stream", board, "--freed", "127.0.0.1:9"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "--freed needs a camera's pose: configure virtual axes in Dragonframe or the" in line
