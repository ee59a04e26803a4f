"""Draws the steps of the page that installs framestep, for docs/start/by-the-page.md: what the
browser shows of a card becomes an SVG, which is text and so can be kept in the repository.

python -m host_tests.console.drawings          draw them again
"""

import re
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

from playwright.sync_api import Locator, Page, expect, sync_playwright

from framestep_tools.building.board_files import ROOT
from framestep_tools.site import install_page
from host_tests.console.conftest import FLAGS, Stage, browser_program
from host_tests.console.looking import go_to, wait_rest

FOLDER = ROOT / "docs/start"
_SVG = "http://www.w3.org/2000/svg"
_WIDTH = 720
_RIG = {"name": "my slider", "motor_count": 1, "estop": "nc"}
_FORM = "motor_count", "estop", "estop_cuts_power"
# Boxes, lines of text and fields of an element: [kind, numbers, texts], in pixels from its corner
_SHOWN = """(root) => {
    const found = [], from = root.getBoundingClientRect();
    const at = ({left, top, width, height}) => [left - from.left, top - from.top, width, height];
    const text = (said, box, style) => said.trim() && found.push(['text', said.trim(), ...at(box), parseFloat(style.fontSize), style.fontWeight, style.color]);
    const lines = (node, style) => {
        const range = document.createRange();
        let line = '', box = null;
        for (const {0: word, index} of node.data.matchAll(/\\S+/g)) {
            range.setStart(node, index);
            range.setEnd(node, index + word.length);
            const rect = range.getBoundingClientRect();
            if (box && rect.top > box.top + 2) { text(line, box, style); box = null; line = ''; }
            if (rect.width === 0) continue;
            line += `${line && ' '}${word}`;
            box = box ? new DOMRect(box.left, box.top, rect.right - box.left, box.height) : rect;
        }
        if (box) text(line, box, style);
    };
    const visit = (element) => {
        const style = getComputedStyle(element), box = element.getBoundingClientRect();
        if (style.display === 'none' || style.visibility === 'hidden' || element.matches('img, canvas')) return;
        const paint = style.backgroundColor.startsWith('rgba') && style.backgroundColor.endsWith(' 0)') ? 'none' : style.backgroundColor;
        const edge = parseFloat(style.borderTopWidth) && style.borderTopStyle !== 'none' ? style.borderTopColor : 'none';
        const round = element.matches('[type=radio]') ? box.width / 2 : parseFloat(style.borderTopLeftRadius) || 0;
        const ticked = element.matches('[type=radio], [type=checkbox]');
        if (box.width && (paint !== 'none' || edge !== 'none' || ticked)) found.push(['box', ...at(box), round, paint, ticked ? 'rgb(110, 119, 129)' : edge]);
        if (element.matches('ol > li')) text(`${[...element.parentElement.children].indexOf(element) + 1}.`, new DOMRect(box.left - 20, box.top, 13, parseFloat(style.fontSize) * 1.45), style);
        if (element.matches('svg')) {
            const copy = element.cloneNode(true), parts = copy.querySelectorAll('*');
            element.querySelectorAll('*').forEach((each, i) => {
                const drawn = getComputedStyle(each);
                for (const key of ['fill', 'stroke', 'stroke-width', 'font-size']) parts[i].setAttribute(key, drawn.getPropertyValue(key));
                parts[i].removeAttribute('class');
            });
            for (const name of ['class', 'role', 'aria-label']) copy.removeAttribute(name);
            found.push(['svg', new XMLSerializer().serializeToString(copy), ...at(box)]);
        } else if (ticked) {
            if (element.checked) found.push(['box', ...at(new DOMRect(box.left + 3, box.top + 3, box.width - 6, box.height - 6)), Math.max(round - 3, 1), 'rgb(36, 110, 185)', 'none']);
        } else if (element.matches('input, select, textarea')) {
            const said = element.matches('select') ? element.selectedOptions[0]?.text ?? '' : element.value || element.placeholder;
            const range = document.createElement('span');
            range.style.cssText = `font: ${style.font}; position: absolute; white-space: pre; visibility: hidden`;
            range.textContent = said;
            document.body.append(range);
            const width = Math.min(range.getBoundingClientRect().width, box.width - 16), size = parseFloat(style.fontSize) * 1.3;
            range.remove();
            text(said, new DOMRect(box.left + 8, box.top + (box.height - size) / 2, width, size), style);
        } else {
            for (const child of element.childNodes) {
                if (child.nodeType === Node.TEXT_NODE) lines(child, style);
                else if (child.nodeType === Node.ELEMENT_NODE) visit(child);
            }
        }
    };
    visit(root);
    return [from.width, from.height, found];
}"""  # noqa: E501


def drawing(shown: Locator, title: str) -> str:
    """Return an element as an SVG."""
    width, height, found = shown.evaluate(_SHOWN)
    svg = ElementTree.Element(
        f"{{{_SVG}}}svg",
        {
            "viewBox": f"-4 -4 {width + 8:.0f} {height + 8:.0f}",
            "width": f"{width + 8:.0f}",
            "role": "img",
            "aria-label": title,
            "font-family": "system-ui, sans-serif",
        },
    )
    for kind, *values in found:
        if kind == "box":
            x, y, w, h, r, paint, edge = values
            ElementTree.SubElement(
                svg,
                f"{{{_SVG}}}rect",
                {**_numbers(x=x, y=y, width=w, height=h, rx=r), "fill": paint, "stroke": edge},
            )
        elif kind == "svg":
            text, x, y, w, h = values
            inner = ElementTree.fromstring(text)
            inner.attrib |= _numbers(x=x, y=y, width=w, height=h)
            svg.append(inner)
        else:
            said, x, y, w, h, size, weight, colour = values
            line = ElementTree.SubElement(
                svg,
                f"{{{_SVG}}}text",
                {
                    **_numbers(x=x, y=y + 0.79 * h, textLength=w),
                    "font-size": f"{size:g}",
                    "font-weight": weight,
                    "fill": colour,
                },
            )
            line.text = said
    ElementTree.register_namespace("", _SVG)
    ElementTree.indent(svg, "")
    return ElementTree.tostring(svg, encoding="unicode") + "\n"


def _numbers(**values: float) -> dict[str, str]:
    return {name: f"{value:.1f}".removesuffix(".0") for name, value in values.items()}


def _card(page: Page, name: str) -> Locator:
    return page.get_by_role("article", name=name, exact=True)


def drawings(stage: Stage, folder: Path) -> Iterator[tuple[str, str]]:
    """Yield (name, SVG) of each step. The device is a simulated Pico with one motor."""
    device = stage.simulated(_RIG, 1, wired=True)
    image = folder / "image"
    image.write_bytes(bytes(256))
    saved = stage.saved(folder / "page", lambda to: install_page.make(to, {"pico": image}, {}))
    page = stage.page(saved.url, viewport={"width": _WIDTH, "height": 900})
    page.evaluate("window.showDirectoryPicker = async () => {}")
    saved.give_ports(page, device.tcp, device.tcp)
    page.locator('input[value="pico"]').check()
    page.evaluate("document.querySelector('.sum').parentElement.remove()")  # of the real image
    yield "page-1-image", drawing(_card(page, "Its image"), "The image goes onto the board's drive")
    go_to(page, "2. Connect")
    page.get_by_role("button", name="Choose Dragonframe's port…").click()
    expect(_card(page, "Connect")).to_contain_text("answers: firmware")
    yield "page-2-connect", drawing(_card(page, "Connect"), "The board answers at its port")
    go_to(page, "3. Rig file")
    expect(page.get_by_label("motor_count", exact=True)).to_be_attached()  # the form has been made
    page.evaluate("document.querySelectorAll('details').forEach((fold) => { fold.open = true; })")
    for key, value in (("motor_count", "1"), ("estop", '"nc"'), ("estop_cuts_power", "true")):
        field = page.get_by_label(key, exact=True)
        field.select_option(value) if key != "motor_count" else field.fill(value)
    page.evaluate(
        """keys => document.querySelectorAll('.rig-form :is(.setting, fieldset)').forEach(each => {
            each.hidden = !keys.includes(each.querySelector('input, select')?.ariaLabel);
            if (each.hidden) each.style.display = 'none';
        })""",
        list(_FORM),
    )
    page.evaluate(
        """() => document.querySelectorAll('.rig-form details').forEach((fold) => {
            if (![...fold.querySelectorAll('.setting')].some((each) => !each.hidden)) fold.remove();
        })"""
    )
    yield "page-3-rig", drawing(_card(page, "Rig file"), "A form for the rig's settings")
    go_to(page, "4. Motors")
    tried = _card(page, "One motor at a time")
    tried.get_by_label("The load is off").check()
    expect(tried.get_by_text("0", exact=True)).to_be_visible()  # its position has come
    yield "page-4-motors", drawing(tried, "One motor moves while a button is held")
    go_to(page, "5. First move")
    page.get_by_role("button", name="Move there and back").click()
    first = _card(page, "First move")
    expect(first.get_by_role("status")).to_have_text(re.compile("That was the first move"))
    wait_rest(page)
    yield "page-5-first-move", drawing(first, "A motor has gone there and back")


def main() -> None:
    """Write the drawings."""
    with sync_playwright() as playwright, TemporaryDirectory() as scratch:
        browser = playwright.chromium.launch(executable_path=browser_program(), args=FLAGS)
        stage = Stage(browser)
        try:
            for name, text in drawings(stage, Path(scratch)):
                (FOLDER / f"{name}.svg").write_text(text)
                print(FOLDER.relative_to(ROOT) / f"{name}.svg")
        finally:
            stage.close()
            browser.close()


if __name__ == "__main__":
    main()
