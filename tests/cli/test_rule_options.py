"""The controller's options: each rule's own defaults, and a rule in a user's file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from conftest import square_survey

from grebe.cli.flags import sentence
from grebe.cli.main import grebe
from grebe.control.rules.dual import Dual
from grebe.control.rules.lookahead import Lookahead
from grebe.control.rules.single import Single
from grebe.core.errors import UsageError
from grebe.io.store import SurveyFile
from grebe.workflow.files import write_survey
from grebe.workflow.steering_names import rule_named

OWN = """
from grebe.control.rules.lookahead import Lookahead

def rule():
    return Lookahead(stages=20)
"""


@pytest.mark.parametrize("rule", [Single(), Dual(), Lookahead()], ids=lambda r: type(r).__name__)
def test_a_rule_that_is_given_no_weights_has_its_own(
    rule: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []

    def steered_by(one: object, *_: object) -> object:
        made.append(one)
        raise UsageError("that is enough")

    monkeypatch.setattr("grebe.cli.run_command.steered_by", steered_by)
    write_survey(tmp_path / "s.gpkg", square_survey())
    name = type(rule).__name__.lower()
    CliRunner().invoke(grebe, ["run", str(tmp_path / "s.gpkg"), "--rule", name])
    assert made == [rule]


def test_a_user_s_rule_is_sailed_and_resumed_by_name(tmp_path: Path) -> None:
    own, file = tmp_path / "own.py", tmp_path / "s.gpkg"
    own.write_text(OWN)
    assert rule_named(f"python:{own}") == Lookahead(stages=20)
    write_survey(file, square_survey())
    words = ["run", str(file), "--rule", f"python:{own}", "--json"]
    done = CliRunner().invoke(grebe, words, catch_exceptions=False)
    assert json.loads(done.stdout.splitlines()[-1])["ended"] == "mission_complete"
    with SurveyFile.open(file) as kept:
        assert json.loads(kept.meta()["run"])["rule"] == f"python:{own}"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "no such file"),
        ("x = 1", "no function rule"),
        ("def rule(): return 3", "does not return a rule"),
        ("def rule(): return 1 / 0", "rule\\(\\) fails"),
        ("import nothing_such", "cannot be run"),
        ("def rule(:", "cannot be run"),
    ],
)
def test_a_file_that_holds_no_rule_is_refused(tmp_path: Path, text: str | None, says: str) -> None:
    path = tmp_path / "own.py"
    if text is not None:
        path.write_text(text)
    with pytest.raises(UsageError, match=says):
        rule_named(f"python:{path}")


def test_the_numbers_of_a_rule_of_one_s_own_are_set_in_its_file(tmp_path: Path) -> None:
    own = tmp_path / "own.py"
    own.write_text(OWN)
    with pytest.raises(UsageError, match="set stages in the file"):
        rule_named(f"python:{own}", {"stages": 5, "beta": None})


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("--rule dual --thrift 1", "--thrift is not a setting of the rule dual; lookahead has it."),
        ("--alpha 2", "--alpha is not a setting of the rule lookahead; single and dual have it."),
        ("--thrift 9", "thrift is 9; give 0 to 4"),
        ("--thrift nan", "thrift is nan"),
    ],
)
def test_a_number_that_would_change_nothing_or_stop_the_boat_is_refused(
    words: str, says: str, tmp_path: Path
) -> None:
    write_survey(tmp_path / "s.gpkg", square_survey())
    done = CliRunner().invoke(grebe, ["run", str(tmp_path / "s.gpkg"), *words.split()])
    assert isinstance(done.exception, UsageError)
    assert says in sentence(done.exception)


def test_a_preview_s_next_command_steers_as_it_was_asked(tmp_path: Path) -> None:
    write_survey(tmp_path / "s.gpkg", square_survey())
    words = ["run", str(tmp_path / "s.gpkg"), "--preview", "--thrift", "0.5", "--horizon", "20"]
    done = CliRunner().invoke(grebe, words, catch_exceptions=False)
    assert "--horizon 20 --thrift 0.5" in done.output
