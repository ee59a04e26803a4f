"""What axe-core finds in each view: names, contrast, the order of headings, roles."""

import pytest

from framestep_tools.building.board_files import ROOT
from host_tests.console.looking import go_to
from host_tests.console.pictures import LOOKS, VIEWS, crane, prepare
from host_tests.covering import sweep

AXE = ROOT / "tools/framestep_emulator/board/node_modules/axe-core/axe.min.js"
FINDINGS = """async () => (await axe.run({resultTypes: ['violations']})).violations.map(
    found => `${found.id}: ${found.nodes.map(node => node.target.join(' ')).join(', ')}`)"""


@pytest.fixture(scope="module")
def served(shared_stage):
    return crane(shared_stage)


@pytest.mark.parametrize(
    "looks", sweep(["wide", "dark", "phone", "dark phone"], "wide", "dark phone")
)
def test_nothing_is_found_but_a_mistake(served, stage, looks):
    options = {}
    for look in looks.split():
        options |= LOOKS[look]
    page = stage.page(served.url, **options)
    prepare(page)
    page.evaluate(AXE.read_text())
    found = {}
    for view in VIEWS:
        go_to(page, view)
        page.evaluate("document.querySelectorAll('details').forEach(fold => { fold.open = true; })")
        if findings := page.evaluate(FINDINGS):
            found[view] = findings
    assert found == {}
    go_to(page, VIEWS[0])
    page.evaluate("document.querySelector('main').innerHTML += '<h5>too low</h5><input>'")
    mistakes = [name.partition(":")[0] for name in page.evaluate(FINDINGS)]
    assert mistakes == ["heading-order", "label"]
