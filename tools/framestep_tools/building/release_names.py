"""Names of a release's files."""


def image_name(board: str, version: str) -> str:
    """Return the name of a board's image."""
    return f"framestep-{board}-{version}.uf2"


def files_name(board: str, version: str) -> str:
    """Return the name of the archive with a board's files."""
    return f"framestep-{board}-{version}.zip"


def page_files_name(board: str, version: str) -> str:
    """Return the name of a board's files as the page that installs framestep loads them."""
    return f"framestep-{board}-{version}.json"


def pages_name(version: str) -> str:
    """Return the name of the archive with the pages to try and to install framestep."""
    return f"framestep-pages-{version}.zip"
