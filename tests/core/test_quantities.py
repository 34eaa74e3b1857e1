"""The registry of quantities: the required fields of an entry, and its round trip."""

import copy
import json
import pickle
import re
import tomllib

import numpy as np
import pytest

from grebe.core.errors import InputError
from grebe.core.quantities import BUILTIN, LIMNOLOGICAL, Quantities, quantities_of
from grebe.core.samples import Flag, Samples, gross_range_flag, gross_range_flags
from grebe.io.readers.quantities import read_quantities, user_quantities

ENTRY = """
[tryptophan_rfu]
label = { en = "Tryptophan", fr = "Tryptophane" }
unit = "RFU"
cf_unit = "1"
span = [0, 100]
resolution = 0.01
columns = ['trp(rfu)?']
"""


def read(text, base=BUILTIN):
    return quantities_of(tomllib.loads(text), base, "here")


def test_the_paper_s_five_come_first():
    assert list(BUILTIN)[:5] == list(LIMNOLOGICAL)
    assert all(one.lake is not None for one in LIMNOLOGICAL.values())


@pytest.mark.parametrize("key", BUILTIN)
def test_an_entry_comes_back_from_its_table_whole(key):
    one = BUILTIN[key]
    table = json.loads(json.dumps(one.as_table(), allow_nan=False))
    assert quantities_of({key: table}, {}, "here")[key] == one
    assert copy.deepcopy(one) == pickle.loads(pickle.dumps(one)) == one


@pytest.mark.parametrize("key", BUILTIN)
def test_limits_lie_within_what_is_possible(key):
    one = BUILTIN[key]
    low, high = one.limits.suspect_span
    assert one.limits.fail_span == one.span
    assert one.span[0] <= low < high <= one.span[1]
    assert 0 < one.limits.spike_suspect < one.limits.spike_fail
    assert one.resolution < one.limits.spike_suspect
    if one.lake is not None:
        assert low <= one.lake.mean - 3 * one.lake.sd
        assert one.lake.mean + 3 * one.lake.sd <= high


def test_a_new_entry_needs_no_limits_and_no_lake():
    one = read(ENTRY)["tryptophan_rfu"]
    assert one.label_in("fr") == "Tryptophane"
    assert one.label_in("de") == "Tryptophan"
    assert one.limits.fail_span == one.limits.suspect_span == (0.0, 100.0)
    assert one.lake is None


def test_an_entry_that_is_known_is_changed_and_not_lost():
    changed = read("[ph]\nlimits = { suspect_span = [6.5, 8.5] }")["ph"]
    assert changed.limits.suspect_span == (6.5, 8.5)
    assert changed.limits.spike_fail == BUILTIN["ph"].limits.spike_fail
    assert changed.label == "pH"
    assert read("[chlorophyll_rfu]")["chlorophyll_rfu"] == BUILTIN["chlorophyll_rfu"]
    assert BUILTIN["ph"].limits.suspect_span == (4.0, 10.5)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("new = 3", "new is not a table"),
        ("[new]\nunit = 'm'", "is new and lacks label, cf_unit, span, resolution"),
        (ENTRY.replace("columns", "colums"), "holds 'colums'"),
        (ENTRY.replace("[0, 100]", "[100, 0]"), "give "),
        (ENTRY.replace("[0, 100]", "[0, nan]"), "give "),
        (ENTRY.replace("0.01", "'fine'"), "'fine', which is not a number"),
        (ENTRY.replace("0.01", "true"), "True, which is not a number"),
        (ENTRY.replace("trp(", "trp(("), "not a regular expression"),
        (ENTRY.replace("en = ", "de = "), "no English text"),
        (ENTRY.replace("tryptophan_rfu", "geom"), "cannot be a quantity's key"),
        (ENTRY.replace("tryptophan_rfu", "Trp"), "cannot be a quantity's key"),
        (ENTRY.replace("tryptophan_rfu", "trp_qc"), "cannot be a quantity's key"),
        (ENTRY + "limits = { spike = 1 }", "holds 'spike'"),
        (ENTRY + "limits = { spike_fail = -1 }", "give 0 or more"),
        (ENTRY + "lake = { mean = 3 }", "lake must be a table of mean, range_share, sd"),
        (ENTRY + "lake = { mean = 3, sd = 0, range_share = 1, structured_share = 1 }", "positive"),
        (ENTRY + "air_share = 2", "a share between"),
        (ENTRY + "mapped = 1", "true or false"),
    ],
)
def test_an_entry_that_cannot_be_is_named(text, says):
    with pytest.raises(InputError, match=rf"here: .*{re.escape(says)}"):
        read(text)


def test_a_registry_is_extended_and_cut_without_being_changed():
    more = BUILTIN.extended(read(ENTRY))
    assert len(more) == len(BUILTIN) + 1
    assert "tryptophan_rfu" not in BUILTIN
    assert list(more.subset(["tryptophan_rfu", "ph"])) == ["ph", "tryptophan_rfu"]
    with pytest.raises(InputError, match="no quantity 'salt'"):
        more.subset(["salt"])
    with pytest.raises(InputError, match="defined twice"):
        Quantities([BUILTIN["ph"], BUILTIN["ph"]])
    with pytest.raises(TypeError):
        BUILTIN["ph"].labels["en"] = "x"


def test_a_file_is_read_and_the_one_beside_a_survey_is_found(tmp_path):
    survey = tmp_path / "s.gpkg"
    assert len(user_quantities(None, survey)) == 0
    (tmp_path / "quantities.toml").write_text(ENTRY)
    assert list(user_quantities(None, survey)) == ["tryptophan_rfu"]
    other = tmp_path / "other.toml"
    other.write_text("[ph]")
    assert list(user_quantities(other, survey)) == ["ph"]
    other.write_text("[ph")
    with pytest.raises(InputError, match=r"other\.toml is not TOML"):
        read_quantities(other)


def test_columns_of_samples_must_agree():
    ok = {"times": np.arange(3.0), "positions": np.zeros((3, 2)), "quantities": BUILTIN}
    assert len(Samples.of(values={"ph": np.full(3, 7.0)}, **ok)) == 3
    with pytest.raises(InputError, match="ph of shape"):
        Samples.of(values={"ph": np.full(2, 7.0)}, **ok)
    with pytest.raises(InputError, match="no quantity 'salt'"):
        Samples.of(values={"salt": np.full(3, 7.0)}, **ok)


def test_flags_of_many_values_are_those_of_each():
    values = np.array([np.nan, -1.0, 0.0, 5.0, 10.0, 10.1, np.inf])
    each = [gross_range_flag(value, (0.0, 10.0)) for value in values.tolist()]
    assert gross_range_flags(values, (0.0, 10.0)).tolist() == each
    assert each == [Flag.MISSING, Flag.FAIL, *[Flag.GOOD] * 3, Flag.FAIL, Flag.MISSING]
