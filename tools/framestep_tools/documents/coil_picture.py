"""Draw docs/start/coils.svg: which wires of a motor belong to one coil, and where they go.

python -m framestep_tools.documents.coil_picture          draw it again
"""

from ..paths import ROOT

PICTURE = ROOT / "docs/start/coils.svg"
WIDTH, HEIGHT = 760, 300
# A coil's name, its colour, and the places of its wires
COILS = (("A", "#3a9d5d", (80, 120)), ("B", "#3b7dd8", (180, 220)))
STYLE = """
text { font: 13px system-ui, sans-serif; fill: #24292f; }
.name { font-weight: 600; font-size: 15px; }
.page { fill: #fff; } .box { fill: #f6f8fa; stroke: #57606a; } .pin { fill: #24292f; }
.wire { fill: none; stroke-width: 3; } .lead { fill: none; stroke: #24292f; stroke-width: 1.5; }
"""


def coil(colour: str, top: int, bottom: int) -> str:
    """Draw a winding between two wires."""
    turns = (bottom - top) // 4
    arcs = "".join(f" a8 {turns / 2:g} 0 0 0 0 {turns}" for _ in range(4))
    return f'<path class="wire" stroke="{colour}" d="M200 {top} H120 v0{arcs} H200"/>'


def meter(x: int, y: int, first: int, second: int, shown: str) -> str:
    """Draw an ohmmeter at x, y, with its leads on two wires, and what it shows."""
    at = 250 if shown == "2 Ω" else 300
    return (
        f'<path class="lead" d="M{x} {y} L{at} {first} M{x} {y} L{at} {second}"/>'
        f'<rect class="box" x="{x - 38}" y="{y - 20}" width="76" height="40" rx="6"/>'
        f'<text x="{x}" y="{y + 5}" text-anchor="middle" class="name">{shown}</text>'
        f'<circle class="pin" cx="{at}" cy="{first}" r="4"/>'
        f'<circle class="pin" cx="{at}" cy="{second}" r="4"/>'
    )


def drawing() -> str:
    """Return the text of docs/start/coils.svg."""
    parts = [
        f'<rect class="page" width="{WIDTH}" height="{HEIGHT}"/>',
        '<rect class="box" x="40" y="50" width="140" height="200" rx="8"/>',
        '<text class="name" x="110" y="38" text-anchor="middle">motor</text>',
        '<rect class="box" x="560" y="50" width="150" height="200" rx="8"/>',
        '<text class="name" x="635" y="38" text-anchor="middle">driver</text>',
    ]
    for name, colour, (top, bottom) in COILS:
        parts.append(coil(colour, top, bottom))
        parts.append(f'<text class="name" x="62" y="{(top + bottom) / 2 + 5:g}">{name}</text>')
        for number, y in ((1, top), (2, bottom)):
            parts.append(f'<path class="wire" stroke="{colour}" d="M200 {y} H560"/>')
            parts.append(f'<circle class="pin" cx="560" cy="{y}" r="4"/>')
            parts.append(f'<text x="572" y="{y + 5}">{name}{number}</text>')
            other = "AB".index(name) + 1, "AB"[number - 1], name, "+-"[number - 1]
            parts.append(
                f'<text x="604" y="{y + 5}">or {other[0]}{other[1]}, {name}{other[3]}</text>'
            )
    (_, _, (a1, a2)), (_, _, (b1, _)) = COILS
    parts.append(meter(250, 30, a1, a2, "2 Ω"))
    parts.append('<text x="300" y="35">one coil</text>')
    parts.append(meter(420, 275, a2, b1, "open"))
    parts.append('<text x="470" y="280">two coils</text>')
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        'aria-label="A motor with two coils: a meter shows a few ohms between the two wires of a '
        "coil, and nothing between wires of two coils; one coil goes to A1 and A2 of the driver, "
        f'the other to B1 and B2">\n<style>{STYLE}</style>\n' + "\n".join(parts) + "\n</svg>\n"
    )


def main() -> None:
    """Write docs/start/coils.svg."""
    PICTURE.write_text(drawing())


if __name__ == "__main__":
    main()
