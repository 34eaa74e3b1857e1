"""Documentation that can fail."""

import importlib
import re
from pathlib import Path

import click
import pytest

import grebe
from grebe.cli.main import COMMANDS
from grebe.core.vessel import PRESETS
from grebe.io.store import schema

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def test_every_public_name_can_be_imported_and_is_documented():
    for name in grebe.__all__:
        assert getattr(grebe, name).__doc__


def test_every_option_has_a_help_text():
    for name in COMMANDS:
        command = importlib.import_module(f"grebe.cli.{name}_command").command
        assert command.help
        for parameter in command.params:
            if isinstance(parameter, click.Option):
                assert parameter.help, f"{name} {parameter.name}"


def test_the_survey_file_s_page_names_every_layer_and_column():
    page = (ROOT / "docs" / "survey-file.md").read_text()
    for layer, (_, columns) in schema._LAYERS.items():
        assert f"`{layer}`" in page
        for column in re.findall(r"(\w+) (?:TEXT|DOUBLE|INTEGER|DATETIME)", columns):
            assert f"`{column.removesuffix('_qc')}`" in page, column


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_and_named_files_exist(page):
    text = page.read_text()
    for target in re.findall(r"\]\(([^)#h][^)]*)\)", text):
        assert (page.parent / target).exists(), target
    for target in re.findall(r"`((?:grebe|tests|benchmarks)/[\w/]+\.py)`", text):
        base = ROOT / "src" if target.startswith("grebe/") else ROOT
        assert (base / target).exists(), target


def test_tests_named_in_the_theory_exist():
    written = "".join(p.read_text() for p in (ROOT / "tests").rglob("test_*.py"))
    for name in re.findall(r"`(test_\w+)`", (ROOT / "docs" / "theory.md").read_text()):
        assert f"def {name}(" in written, name


def test_commands_in_the_readme_exist():
    for name in re.findall(r"^    grebe (\w+)", (ROOT / "README.md").read_text(), re.MULTILINE):
        assert name in COMMANDS


def test_every_preset_names_its_source():
    assert all(vessel.source for vessel in PRESETS.values())
