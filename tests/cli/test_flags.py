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
from grebe.cli.options import MOMENT
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


def test_every_default_is_in_the_help():
    for name in COMMANDS:
        command = importlib.import_module(f"grebe.cli.{name}_command").command
        for option in command.params:
            if not isinstance(option, click.Option) or option.is_flag or option.multiple:
                continue
            if isinstance(option.default, str | int | float):
                shown = option.show_default or "[default:" in (option.help or "")
                assert shown, (name, option.opts)


def test_no_message_of_a_command_names_a_flag_twice():
    """A sentence with a flag in it needs no setting, whose flag would be put behind it."""
    seen = 0
    for path in (PACKAGE / "cli").glob("*.py"):
        for call in (one for one in ast.walk(ast.parse(path.read_text())) if is_call(one)):
            message = " ".join(text for one in call.args for text in texts_in(one))
            for keyword in (one for one in call.keywords if one.arg == "settings"):
                for setting in texts_in(keyword.value):
                    seen += 1
                    assert FLAGS.get(setting) not in re.findall(r"--[a-z-]+", message), message
    assert seen > 5


def is_call(node):
    return isinstance(node, ast.Call)


def texts_in(tree):
    found = (one.value for one in ast.walk(tree) if isinstance(one, ast.Constant))
    return [value for value in found if isinstance(value, str)]


def test_a_time_is_written_as_the_help_shows_it():
    option = click.Option(["--moment"], type=MOMENT)
    command = click.Command("map", params=[option])
    context = click.Context(command)
    assert "--moment TIME|middle" in command.get_help(context)
    assert option.process_value(context, "middle") == "middle"
    with pytest.raises(click.BadParameter, match="MIDDLE") as caught:
        option.process_value(context, "MIDDLE")
    assert "'--moment'" in caught.value.format_message()


def test_the_flag_stands_behind_the_sentence():
    with pytest.raises(UsageError) as caught:
        PlanSettings(cell_m=-1.0)
    assert "--" not in str(caught.value)
    assert sentence(caught.value).endswith("(--cell)")
