"""Documentation that can fail."""

import importlib
import inspect
import re
from dataclasses import make_dataclass
from importlib.metadata import version
from pathlib import Path

import click
import pytest

import grebe
from grebe.cli.main import COMMANDS
from grebe.core.vessel import PRESETS
from grebe.io.store import schema

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def is_documented(thing):
    """Whether it has a docstring of its own: a dataclass or an exception without one is given
    its signature's or its parent's.
    """
    written = vars(thing).get("__doc__") if inspect.isclass(thing) else inspect.getdoc(thing)
    return bool(written) and not written.startswith(f"{getattr(thing, '__name__', '')}(")


def test_a_docstring_that_python_made_does_not_count():
    undocumented = make_dataclass("Undocumented", ["x"])
    assert undocumented.__doc__ == "Undocumented(x: 'typing.Any')"
    assert not is_documented(undocumented)
    assert not is_documented(type("Heir", (grebe.Survey,), {}))
    assert is_documented(grebe.Survey)


def test_the_package_says_its_version():
    assert grebe.__version__ == version("grebe")


@pytest.mark.parametrize("name", grebe.__all__)
def test_every_public_name_can_be_imported_and_is_documented(name):
    assert is_documented(getattr(grebe, name))


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
        found = re.findall(r"(\w+) (?:TEXT|DOUBLE|INTEGER|DATETIME)", columns)
        assert found, layer
        for column in found:
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
    names = re.findall(r"`(test_\w+)`", (ROOT / "docs" / "theory.md").read_text())
    assert names
    for name in names:
        assert f"def {name}(" in written, name


def test_commands_in_the_readme_exist():
    names = re.findall(r"^    grebe (\w+)", (ROOT / "README.md").read_text(), re.MULTILINE)
    assert names
    assert set(names) <= set(COMMANDS)


def test_every_preset_names_its_source():
    assert all(vessel.source for vessel in PRESETS.values())


def test_a_name_of_version_0_1_still_serves_and_says_its_new_one():
    with pytest.warns(DeprecationWarning, match=r"grebe\.fly is now grebe\.simulate"):
        assert grebe.fly is grebe.simulate
