"""The paper's figures pass their checks, and the command says so."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from grebe.cli.main import grebe
from grebe.core.errors import IncompleteError
from grebe.paper import reproduce, scenes
from grebe.paper.reproduce import Check, Reproduction


def test_the_two_paths_of_fig_1_are_mirror_images():
    one, other = scenes.mirrored_paths()
    assert len(one.targets) == len(other.targets) == 5
    for a, b in zip(one.targets, other.targets, strict=True):
        assert a.centre == pytest.approx((b.centre[0], -b.centre[1]))
        assert a.polygon.area == pytest.approx(b.polygon.area)


def test_the_printed_starts_and_settings_are_the_paper_s():
    assert scenes.four_sets().start == pytest.approx((0, 0, np.pi / 2, 0, 0, 0))
    scene = scenes.exploration()
    assert scene.start == pytest.approx((20, 105, -np.pi / 2, 0, 0, 0))
    assert (scene.rule.stages, scene.rule.step_s) == (15, 1.0)
    whole = sum(t.polygon.area == pytest.approx(25.0) for t in scene.targets)
    assert whole > 0.7 * len(scene.targets)


def test_the_targets_of_fig_7_cover_the_region():
    covered = sum(t.polygon.area for t in scenes.exploration().targets)
    assert covered == pytest.approx(scenes.region().area, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(reproduce.FIGURES))
def test_each_figure_shows_what_it_must(tmp_path, name):
    made = reproduce.FIGURES[name](tmp_path, scenes.BOAT)
    assert made.holds, [check for check in made.checks if not check.holds]
    assert made.picture.stat().st_size > 10_000


def fake(holds, *signs):
    signs = list(signs) or ["fossen"]

    def draw(out, boat):
        assert boat.yaw_coupling == signs.pop()
        picture = out / "fig2.png"
        picture.write_bytes(b"")
        check = Check(what="a number", found="1", holds=holds)
        return Reproduction(figure="fig2", picture=picture, checks=(check,))

    return draw


def test_the_command_names_what_does_not_hold(tmp_path, monkeypatch):
    monkeypatch.setitem(reproduce.FIGURES, "fig2", fake(holds=False))
    done = CliRunner().invoke(grebe, ["paper", "fig2", "--out", str(tmp_path)])
    assert isinstance(done.exception, IncompleteError)
    assert "NOT  a number: 1" in done.output


def test_the_command_prints_json(tmp_path, monkeypatch):
    monkeypatch.setitem(reproduce.FIGURES, "fig2", fake(True, "printed"))
    words = ["paper", "fig2", "--out", str(tmp_path), "--json", "--printed-sign"]
    done = CliRunner().invoke(grebe, words)
    assert json.loads(done.stdout)[0]["checks"][0]["holds"] is True
