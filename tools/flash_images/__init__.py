"""Images of flash: UF2 files, what a firmware says of itself, and file systems."""


class FlashImageError(Exception):
    """A file is not what it should be. The text says why."""
