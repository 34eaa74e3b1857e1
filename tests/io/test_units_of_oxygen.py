"""Oxygen in moles and millilitres, and short names: converted, or reported as doubtful."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from grebe.core.units import conversion, unit_of
from grebe.io.readers.track import RawTrack, read_track

OXYGEN, SATURATION = "dissolved_oxygen_mgl", "oxygen_saturation_percent"
CONDUCTIVITY, CONDUCTANCE_25 = "conductivity_uscm", "specific_conductance_uscm"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "track.csv"


def read(path: Path, names: str, *cells: object, **given: str) -> RawTrack:
    """Read the track of a boat that goes north, with `cells` under `names` in each row."""
    rows = [
        ",".join(map(str, (1_600_000_000 + k, 44.4 + 1e-5 * k, -69.6, *cells))) for k in range(20)
    ]
    path.write_text("\n".join([f"time,latitude,longitude,{names}", *rows]))
    return read_track(path, given)


# 250 µmol at 31.9988 g/mol; and 5.6 mL at 1.42903 mg/mL.
@pytest.mark.parametrize(
    ("name", "cell", "mgl"),
    [
        ("DO (µmol/L)", 250, 7.9997),
        ("Dissolved Oxygen (umol/kg)", 250, 7.9997),
        ("DISOXY [umol/L]", 250, 7.9997),
        ("O2 (uM)", 250, 7.9997),
        ("DO (ml/L)", 5.6, 8.002568),
        ("DISOXY (mg/L)", 8.1, 8.1),
    ],
)
def test_moles_and_millilitres_of_oxygen_are_masses(
    path: Path, name: str, cell: float, mgl: float
) -> None:
    track = read(path, name, cell)
    assert track.values[OXYGEN] == pytest.approx(np.full(20, mgl), rel=1e-12)
    assert any("converted from" in note for note in track.notes) == (cell != mgl)
    assert any("a litre is taken as a kilogram" in note for note in track.notes) == ("kg" in name)


def test_moles_of_anything_else_are_no_mass(path: Path) -> None:
    assert not read(path, "Nitrate (umol/L),Chlorophyll (ml/L)", 250, 3).values


def test_a_saturation_is_reckoned_from_moles(path: Path) -> None:
    names = "DO (umol/L),Temp (C)"
    track = read(path, names, 250, 20, oxygen_saturation_percent="DO (umol/L)")
    assert track.values[SATURATION] == pytest.approx(np.full(20, 100 * 7.9997 / 9.092), rel=1e-4)


def test_an_instrument_may_give_moles_by_mass() -> None:
    for spelled, factor in (("umol/kg", 0.0319988), ("mL/L", 1.42903)):
        unit = unit_of(spelled)
        assert unit is not None
        turned = conversion(unit, "mg/L", OXYGEN)
        assert turned is not None
        assert turned(np.array([100.0])) == pytest.approx([100 * factor])
        assert conversion(unit, "mg/L", "nitrate_mgl") is None


@pytest.mark.parametrize(
    ("name", "key", "factor"),
    [
        ("EC (µS/cm)", CONDUCTIVITY, 1),
        ("EC (mS/cm)", CONDUCTIVITY, 1000),
        ("COND", CONDUCTIVITY, 1),
        ("C-uS/cm", CONDUCTIVITY, 1),
        ("C-mS/cm", CONDUCTIVITY, 1000),
        ("SPC-mS/cm", CONDUCTANCE_25, 1000),
        ("SpC", CONDUCTANCE_25, 1),
        ("SpC (mS/cm)", CONDUCTANCE_25, 1000),
        ("EC25 (uS/cm)", CONDUCTANCE_25, 1),
        ("EC (mS/cm @25°C)", CONDUCTANCE_25, 1000),
        ("Conductivity (µS/cm @25°C)", CONDUCTANCE_25, 1),
        ("DO (% CB)", SATURATION, 1),
        ("ODO % local", SATURATION, 1),
        ("DO % Sat", SATURATION, 1),
        ("DISOXY (%)", SATURATION, 1),
    ],
)
def test_short_names_are_known(path: Path, name: str, key: str, factor: float) -> None:
    track = read(path, name, 95)
    assert set(track.values) == {key}
    assert track.values[key] == pytest.approx(np.full(20, 95.0 * factor))


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ("EC", "EC: its header names no unit; taken as µS/cm"),
        ("EC (mS/cm)", "name it so, as specific_conductance_uscm=NAME"),
        ("DISOXY", "DISOXY: its header names no unit; taken as mg/L"),
        ("DO (% CB)", "at the local pressure of the air"),
    ],
)
def test_what_remains_ambiguous_is_reported(path: Path, names: str, said: str) -> None:
    assert any(said in note for note in read(path, names, 95).notes)


def test_nothing_is_reported_without_ambiguity(path: Path) -> None:
    names = "Cond µS/cm,spcond_us_cm,do_mgl,ODO % sat"
    track = read(path, names, 400, 420, 8, 95)
    assert len(track.values) == 4
    assert track.notes == ()


def test_of_two_percentages_that_of_the_sea_s_level_is_taken(path: Path) -> None:
    track = read(path, "ODO % local,ODO % sat", 99, 95)
    assert track.columns[SATURATION] == "ODO % sat"
    assert track.unused == ("ODO % local",)
