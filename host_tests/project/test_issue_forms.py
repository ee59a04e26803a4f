"""The issue forms: valid by GitHub's rules, as far as this checks them, and right about framestep's
boards and commands."""

import re

import pytest
import typer.main
import yaml

from framestep_tools.building.board_files import ROOT, board_data, board_names
from framestep_tools.cli import app

FORMS = sorted((ROOT / ".github/ISSUE_TEMPLATE").glob("*.yml"))
KINDS = {"markdown", "textarea", "input", "dropdown", "checkboxes"}


@pytest.mark.parametrize("form", FORMS, ids=lambda path: path.stem)
def test_form_is_valid(form):
    found = yaml.safe_load(form.read_text())
    assert found.keys() <= {"name", "description", "title", "labels", "assignees", "body"}
    assert found["name"]
    assert found["description"]
    fields = [part for part in found["body"] if part["type"] != "markdown"]
    assert fields
    assert {part["type"] for part in found["body"]} <= KINDS
    ids = [part["id"] for part in fields]
    assert len(set(ids)) == len(ids)
    assert all(re.fullmatch(r"[\w-]+", each) for each in ids)
    assert all(part["attributes"]["label"] for part in fields)


@pytest.mark.parametrize("form", FORMS, ids=lambda path: path.stem)
def test_form_names_commands_and_files_that_exist(form):
    commands = typer.main.get_command(app).commands
    text = form.read_text()
    for command in re.findall(r"`framestep ([a-z]+)", text):
        assert command in commands
    for file in re.findall(r"`(docs/[^`]+)`", text):
        assert (ROOT / file).is_file()


def test_the_fault_report_asks_for_what_helps():
    body = yaml.safe_load((ROOT / ".github/ISSUE_TEMPLATE/fault.yml").read_text())["body"]
    fields = {part["id"]: part["attributes"] for part in body if "id" in part}
    assert {"board", "image", "status", "prove", "rig", "log"} <= fields.keys()
    assert {board_data(name)["name"] for name in board_names()} <= set(fields["board"]["options"])
