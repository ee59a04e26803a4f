"""The first minute, from the front page to a rig that moves."""

from host_tests.console.file_server import FileServer
from host_tests.console.walk import make_site, walk


def test_from_the_front_page_to_a_rig_that_moves(stage, tmp_path):
    server = FileServer(make_site(tmp_path))
    stage.closing(server.close)
    events = list(walk(stage, server.url))
    assert [what for what, _ in events][-2:] == ["the rig moves", "it is at rest again"]
    assert all(seconds < 60 for _, seconds in events), events
