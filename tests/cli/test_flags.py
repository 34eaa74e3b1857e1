"""The library names settings; only the command line knows flags."""

import ast
import importlib
import re
from pathlib import Path

import click
import pytest

import grebe
from grebe.cli.flags import FLAGS, sentence
from grebe.cli.main import COMMANDS
from grebe.core.errors import UsageError
from grebe.core.plan_settings import PlanSettings

PACKAGE = Path(grebe.__file__).parent
# Flags passed to a browser, not to Grebe.
FLAGS_OF_OTHERS = {"report/pdf.py"}


def literals(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def test_no_sentence_of_the_library_names_a_flag():
    """Readers of tracks are no exception: they name the setting `columns`."""
    for path in PACKAGE.rglob("*.py"):
        name = path.relative_to(PACKAGE).as_posix()
        if name.startswith("cli/") or name in FLAGS_OF_OTHERS:
            continue
        assert not [text for text in literals(path) if re.search(r"--[a-z]", text)], name


def test_every_setting_that_an_error_names_has_its_flag():
    named = set()
    # The app is a front end of its own: its settings are the fields of its requests.
    for path in (one for one in PACKAGE.rglob("*.py") if "server" not in one.parts):
        for call in ast.walk(ast.parse(path.read_text())):
            if isinstance(call, ast.Call):
                for keyword in call.keywords:
                    if keyword.arg == "settings" and isinstance(keyword.value, ast.Tuple):
                        named |= {
                            one.value for one in keyword.value.elts if isinstance(one, ast.Constant)
                        }
    assert named
    assert named <= set(FLAGS)


def test_every_flag_in_the_table_is_one_of_a_command():
    flags = set()
    for name in COMMANDS:
        command = importlib.import_module(f"grebe.cli.{name}_command").command
        for parameter in command.params:
            if isinstance(parameter, click.Option):
                flags |= set(parameter.opts)
    assert set(FLAGS.values()) <= flags


def test_the_flag_stands_behind_the_sentence():
    with pytest.raises(UsageError) as caught:
        PlanSettings(cell_m=-1.0)
    assert "--" not in str(caught.value)
    assert sentence(caught.value).endswith("(--cell)")
