"""Draw docs/rig.svg, the moving rig at the top of README: the crane shot of `make demo` from the
side and from above, and its four curves. A browser animates it by itself.

python -m framestep_tools.documents.rig_picture          draw it again
"""

from collections.abc import Iterable

import numpy as np

from ..move.move_file import CAMERA_MOVE, read_move
from ..paths import ROOT

PICTURE = ROOT / "docs/rig.svg"
WIDTH, HEIGHT = 860, 400
SECONDS = 10
FRAMES_A_KEY = 6  # frames between two key positions of the animation
# Pixels and degrees in the drawing for one step
TRACK_PX = 340 / 47_500
BOOM_DEG, SWING_DEG, PAN_DEG = 28 / 24_000, 24 / 9000, 80 / 22_500
ARM = 170  # pixels
COLOURS = {"track": "#3b7dd8", "boom": "#d9822b", "swing": "#3a9d5d", "pan": "#b0478f"}
STYLE = """
text { font: 13px system-ui, sans-serif; fill: #57606a; }
.rail { stroke: #8c959f; stroke-width: 4; } .arm { stroke: #57606a; stroke-width: 7; stroke-linecap: round; }
.body { fill: #57606a; } .lens { fill: #8c959f; } .view { fill: #3b7dd8; opacity: 0.14; }
.curve { fill: none; stroke-width: 2; } .head { stroke: #d1242f; stroke-width: 1.5; }
@media (prefers-color-scheme: dark) {
  text { fill: #9da7b1; } .arm { stroke: #9da7b1; } .body { fill: #9da7b1; } .view { opacity: 0.25; }
}
"""  # noqa: E501


def numbers(values: Iterable[float]) -> list[str]:
    """Format numbers for SVG, with two decimals at most."""
    return [f"{value:.2f}".rstrip("0").rstrip(".") for value in values]


def animated(kind: str, values: Iterable[str]) -> str:
    """Return an animation of an element through these values, once in each round."""
    return (
        f'<animateTransform attributeName="transform" type="{kind}" dur="{SECONDS}s" '
        f'repeatCount="indefinite" values="{";".join(values)}"/>'
    )


def moved(kind: str, values: Iterable[float], rest: str = "", inner: str = "") -> str:
    """Return a moving or turning group. rest: text after each value, such as a centre."""
    keys = [f"{value}{rest}" for value in numbers(values)]
    return f'<g transform="{kind}({keys[0]})">{animated(kind, keys)}{inner}</g>'


def camera(turned: str = "") -> str:
    """Return a camera that looks to the right, with its field of view."""
    return (
        f'<g>{turned}<path class="view" d="M12 0 L120 -38 V38 Z"/>'
        '<rect class="body" x="-16" y="-11" width="28" height="22" rx="3"/>'
        '<rect class="lens" x="12" y="-6" width="10" height="12"/></g>'
    )


def drawing() -> str:
    """Return the text of docs/rig.svg."""
    move = read_move(CAMERA_MOVE)
    steps = {move.names[motor]: np.asarray(track) for motor, track in move.positions.items()}
    keys = {name: track[::FRAMES_A_KEY] for name, track in steps.items()}
    track = 60 + keys["track"] * TRACK_PX
    boom = -keys["boom"] * BOOM_DEG  # an SVG turns clockwise
    swing = -keys["swing"] * SWING_DEG
    pan = keys["pan"] * PAN_DEG

    level = moved("rotate", -boom, inner=camera())
    arm = f'<path class="arm" d="M0 0 H{ARM}"/><g transform="translate({ARM} 0)">{level}</g>'
    dolly = '<rect class="body" x="-28" y="0" width="56" height="14" rx="3"/>'
    post = '<path class="arm" d="M0 0 V-56"/>'
    side = f'{dolly}{post}<g transform="translate(0 -56)">{moved("rotate", boom, inner=arm)}</g>'
    panned = moved("rotate", pan, inner=camera())
    jib = f'<path class="arm" d="M0 0 H{ARM}"/><g transform="translate({ARM} 0)">{panned}</g>'
    above = f'<circle class="body" r="16"/>{moved("rotate", swing, inner=jib)}'
    return f"""<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img"
 aria-label="A camera crane plays a move: from the side, from above, and as curves">
<style>{STYLE}</style>
<text x="20" y="24">from the side: track, boom</text>
<path class="rail" d="M20 176 H440"/>
<g transform="translate(0 158)">{moved("translate", track, " 0", side)}</g>
<text x="20" y="216">from above: track, swing, pan</text>
<path class="rail" d="M20 300 H440"/>
<g transform="translate(0 300)">{moved("translate", track, " 0", above)}</g>
{curves(steps)}
</svg>
"""


def curves(steps: dict[str, np.ndarray]) -> str:
    """Return the four motors' positions over the frames, and a line at the present frame."""
    left, right, low, high = 600, 840, 340, 60
    lines = []
    for i, (name, values) in enumerate(steps.items()):
        u = np.linspace(left, right, len(values))[::FRAMES_A_KEY]
        v = values[::FRAMES_A_KEY]
        y = low - (v - values.min()) / np.ptp(values) * (low - high)
        points = " ".join(f"{a},{b}" for a, b in zip(numbers(u), numbers(y), strict=True))
        colour = COLOURS[name]
        lines.append(f'<polyline class="curve" stroke="{colour}" points="{points}"/>')
        lines.append(
            f'<text x="{left + 60 * i}" y="{low + 26}" style="fill:{colour}">{name}</text>'
        )
    head = moved(
        "translate",
        (0, right - left),
        " 0",
        f'<path class="head" d="M{left} {high - 8} V{low + 4}"/>',
    )
    return "\n".join(lines) + f"\n{head}"


def main() -> None:
    """Write docs/rig.svg."""
    PICTURE.write_text(drawing())


if __name__ == "__main__":
    main()
