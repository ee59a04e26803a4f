"""Puts into the package of `pip install .` and `make release` what is made from the sources.

Links to the repository that builds it, files of boards with an ESP32, and images already built from
these sources (`make image`; an image needs a compiler, so none is built here).
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

ROOT = Path(__file__).resolve().parent
sys.path[:0] = [str(ROOT / "tools"), str(ROOT / "firmware")]

from framestep_tools.paths import linked_outside, repository, site, terminal, version  # noqa: E402


class Links(MetadataHookInterface):
    """A fork's package leads to the fork."""

    def update(self, metadata: dict[str, Any]) -> None:
        readme = linked_outside((ROOT / "README.md").read_text(encoding="utf-8"))
        metadata["readme"] = {"content-type": "text/markdown", "text": readme}
        url = repository()
        if url is None:
            return
        home = site()
        metadata["urls"] = {
            "Homepage": home or url,
            **({"Try it": f"{home}try/index.html"} if home else {}),
            "Source": url,
            "Documentation": f"{url}/tree/v{version()}/docs",
            "Issues": f"{url}/issues",
            "Changelog": f"{url}/blob/v{version()}/CHANGELOG.md",
        }


class Data(BuildHookInterface):
    """An editable package has none of it: it takes everything from the checkout."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable":
            return
        from framestep_tools.board import file_install
        from framestep_tools.building import board_files, images

        put = build_data["force_include"]
        for name, path in terminal().items():
            put[str(path)] = f"framestep_tools/console/page/{name}"
        for board, path in images.images_ready().items():
            put[str(path)] = f"framestep_tools/data/images/{board}.uf2"
        self.made = TemporaryDirectory()
        put[self.made.name] = "framestep_tools/data/files"
        for board in board_files.files_boards():
            for name, content in file_install.package(board).files().items():
                path = Path(self.made.name, board, name)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
