"""Static pages that contain the console's modules: any plain web server can serve them, and nothing
is loaded from other hosts."""

import json
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..console import page_files
from ..errors import ToolError

_HERE = Path(__file__).parent


def bundle(
    name: str,
    out: Path,
    setup: dict[str, Any],
    workers: tuple[str, ...] = (),
    html: str = "index.html",
) -> None:
    """Write index.html, NAME.js, NAME.css and their licences into a folder. page/NAME.js begins.

    setup: what that finds in framestep-console/setup.json; workers: modules of the emulated board
    that run as Web Workers; html: the console's page that it is made of.
    """
    with TemporaryDirectory() as folder:
        console = Path(folder)
        page_files.save(console)
        (console / "setup.json").write_text(json.dumps(setup))
        done = subprocess.run(
            ["node", _HERE / "bundle.mjs", console, out, name, *workers],
            capture_output=True,
            text=True,
        )
        if done.returncode != 0:
            raise ToolError(f"esbuild cannot bundle the page:\n{done.stderr.strip()}")
        text = (console / html).read_text()
        for ours, bundled in (("style.css", f"{name}.css"), ("main.js", f"{name}.js")):
            assert text.count(f'"{ours}"') == 1
            text = text.replace(f'"{ours}"', f'"{bundled}"')
        (out / "index.html").write_text(text)
        for each in ("icon.svg", "rig.schema.json"):
            shutil.copyfile(console / each, out / each)
