"""Puts data into the package of `pip install .` and `make release`: see
tools/framestep_tools/paths.py.

Boards' data and example files, the files of boards with an ESP32, and images already built from
these sources (`make image`; an image needs a compiler, so none is built here).
"""

import shutil
import sys
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parent
TOOLS = "framestep_tools"
IMAGES = "flash_images"
ONLY_IN_A_CHECKOUT = "framestep_emulator"  # it needs node
sys.path[:0] = [str(ROOT / "tools"), str(ROOT / "firmware")]

from framestep_tools.paths import linked_outside, repository, site, version  # noqa: E402


class BuildPackage(build_py):
    """The package of a user; an editable one takes everything from the checkout."""

    def run(self) -> None:
        if not self.editable_mode:
            shutil.rmtree(self.build_lib, ignore_errors=True)  # of an earlier build
            self.packages = [name for name in self.packages if name != ONLY_IN_A_CHECKOUT]
        super().run()
        if not self.editable_mode:
            self.put_data(Path(self.build_lib) / TOOLS)

    def put_data(self, package: Path) -> None:
        from framestep_tools.board import file_install
        from framestep_tools.building import board_files, images
        from framestep_tools.console import page_files

        folder = package / "data"
        for path in sorted((ROOT / "tools/framestep_tools/move").glob("*.csv")):
            self.put(path, package / "move" / path.name)
        emulated = ROOT / "tools/framestep_tools/prove/emulated.json"
        self.put(emulated, package / "prove" / emulated.name)
        page = ROOT / "tools/framestep_tools/console/page"
        for path in sorted(path for path in page.rglob("*") if path.is_file()):
            self.put(path, package / "console/page" / path.relative_to(page))
        for name, path in page_files.terminal().items():
            self.put(path, package / "console/page" / name)
        for path in sorted((ROOT / "boards").glob("*.json")):
            self.put(path, folder / "boards" / path.name)
        for path in sorted((ROOT / "boards").glob("*/*.json")):
            self.put(path, folder / "boards" / path.parent.name / path.name)
        for board in board_files.files_boards():
            for name, content in file_install.package(board).files().items():
                path = folder / "files" / board / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
        for board, path in images.images_ready().items():
            self.put(path, folder / "images" / f"{board}.uf2")

    def put(self, source: Path, target: Path) -> None:
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, target)


def packages(name: str, folder: str) -> list[str]:
    return [name, *(f"{name}.{inner}" for inner in find_packages(folder))]


def project_urls() -> dict[str, str]:
    """Links to the repository that builds the package. A fork's package leads to the fork."""
    url = repository()
    if url is None:
        return {}
    home = site()
    pages = {"Homepage": home, "Try it": f"{home}try/index.html"} if home else {}
    return {
        "Homepage": url,
        **pages,
        "Source": url,
        "Documentation": f"{url}/tree/v{version()}/docs",
        "Issues": f"{url}/issues",
        "Changelog": f"{url}/blob/v{version()}/CHANGELOG.md",
    }


setup(
    version=version(),
    project_urls=project_urls(),
    long_description=linked_outside((ROOT / "README.md").read_text(encoding="utf-8")),
    long_description_content_type="text/markdown",
    packages=[
        *packages("framestep", "firmware/framestep"),
        *packages(TOOLS, "tools/framestep_tools"),
        IMAGES,
        ONLY_IN_A_CHECKOUT,
    ],
    package_dir={
        "framestep": "firmware/framestep",
        TOOLS: "tools/framestep_tools",
        IMAGES: "tools/flash_images",
        ONLY_IN_A_CHECKOUT: "tools/framestep_emulator",
    },
    include_package_data=False,
    cmdclass={"build_py": BuildPackage},
)
