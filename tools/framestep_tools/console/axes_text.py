"""axes.toml for the page: its text, and a new text for it."""

from pathlib import Path
from typing import Any

from ..axes import rig_axes
from ..axes.axes_file import axes_of, axes_text
from ..errors import ToolError
from ..text.text_file import write_text


class AxesText:
    """The axes.toml of the commands; if there is none, the page makes one in framestep's settings
    folder."""

    def __init__(self, given: Path | None):
        self.path = (rig_axes.find(given) or rig_axes.user_file()).absolute()

    def read(self) -> dict[str, Any]:
        """Return the path and the text (empty: no file), or {"error": why it cannot be used}."""
        found: dict[str, Any] = {"path": str(self.path), "text": ""}
        try:
            if rig_axes.exists(self.path):
                text = axes_text(self.path)
                axes_of(text, self.path)
                found["text"] = text
        except ToolError as error:
            found["error"] = str(error)
        return found

    def write(self, text: str) -> dict[str, Any]:
        """Replace the file. Raises ToolError, and changes nothing, if the text is not valid."""
        axes_of(text, self.path)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ToolError(f"cannot write {self.path}: {error.strerror or error}") from None
        write_text(self.path, text)
        return {}
