"""The session in docs/use/repl.md is what the board shows, but for its numbers."""

import re

from framestep_tools.documents import repl_session


def worded(text):
    return re.sub(r"\d+", "0", text)


def test_the_page_has_the_session():
    text = repl_session.PAGE.read_text()
    assert worded(repl_session.updated(text)) == worded(text)
