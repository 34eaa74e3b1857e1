"""Several quantities together: against gstat, against kriging alone, and on synthetic water."""

import csv
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from grebe.mapping.covariance.coregionalisation import Cokriging, Coregionalisation, Observed
from grebe.mapping.covariance.models import CovarianceModel
from grebe.mapping.fields.kriging import krige

HOME = Path(find_spec("skgstat").submodule_search_locations[0])


def observed(model, *pairs):
    """Observations from positions and values of each quantity, in order."""
    positions = np.concatenate([at for at, _ in pairs])
    of = np.repeat(np.arange(len(pairs)), [len(at) for at, _ in pairs])
    return Observed(
        positions=positions,
        values=np.concatenate([values for _, values in pairs]),
        of=of,
        noise=model.nuggets[of],
    )


def test_cokriging_agrees_with_gstat():
    """gstat 2.1-0 and sp 1.6-0, R: log(zinc) at every third place of meuse with log(lead) at all,

    z <- function(a,b,n) { m <- vgm(a,"Exp",150); m <- vgm(b,"Exp",500,add.to=m)
                           vgm(n,"Nug",0,add.to=m) }
    g <- gstat(NULL,"u",u~1,few,model=z(.2,.4,.05),set=list(nocheck=1))
    g <- gstat(g,"v",v~1,meuse,model=z(.15,.3,.03)); g <- gstat(g,c("u","v"),model=z(.14,.3,0))
    predict(g,to)
    """
    with (HOME / "data" / "samples" / "meuse.txt").open() as file:
        rows = list(csv.DictReader(file))
    at = np.array([(float(row["y"]), float(row["x"])) for row in rows])
    zinc, lead = (np.log([float(row[name]) for row in rows]) for name in ("zinc", "lead"))
    model = Coregionalisation(
        kind="exponential",
        sills=(np.array([[0.2, 0.14], [0.14, 0.15]]), np.array([[0.4, 0.3], [0.3, 0.3]])),
        ranges_m=(150.0, 500.0),
        nuggets=np.array([0.05, 0.03]),
    )
    solved = Cokriging(observed(model, (at[::3], zinc[::3]), (at, lead)), model)
    to = np.array([[331000.0, 179500], [331500, 180000], [333000, 181000], [330000, 178700]])
    for wanted, means, variances in (
        (0, [5.99145956926, 5.19510258326, 5.62916715081, 6.25420416108],
         [0.332447084586, 0.380748325386, 0.256582380543, 0.450706609309]),
        (1, [4.92480154272, 4.17161806473, 4.57215042284, 5.14191380400],
         [0.234941912280, 0.240930092030, 0.143870084487, 0.319538527330]),
    ):  # fmt: skip
        mean, variance = solved.estimate(to, wanted)
        assert mean == pytest.approx(means, abs=1e-6)
        # gstat's variance is that of an observation, which is larger by the nugget.
        assert variance + model.nuggets[wanted] == pytest.approx(variances, abs=1e-6)


def test_of_quantities_that_share_nothing_each_is_kriged_alone():
    rng = np.random.default_rng(1)
    model = Coregionalisation(
        kind="exponential",
        sills=(np.diag([1.5, 0.4]),),
        ranges_m=(30.0,),
        nuggets=np.array([0.02, 0.1]),
    )
    here, there = rng.uniform(0, 100, (40, 2)), rng.uniform(0, 100, (70, 2))
    values, others = rng.normal(5, 1, 40), rng.normal(0, 1, 70)
    to = rng.uniform(0, 100, (200, 2))
    together = Cokriging(observed(model, (here, values), (there, others)), model)
    mean, variance = together.estimate(to, 0)
    alone = krige(
        here, values, to,
        CovarianceModel(kind="exponential", sill=1.5, range_m=30.0, nugget=0.02),
    )  # fmt: skip
    assert np.allclose(mean, alone.mean, atol=1e-6)
    assert np.allclose(variance, alone.variance, atol=1e-6)


def test_of_proportional_covariances_at_the_same_places_the_other_tells_nothing():
    """Wackernagel (2003), chapter 25: autokrigeability. The noise must be proportional too."""
    rng = np.random.default_rng(2)
    sill = np.array([[1.0, 0.9], [0.9, 2.0]])
    model = Coregionalisation(
        kind="exponential", sills=(sill,), ranges_m=(30.0,), nuggets=np.zeros(2)
    )
    at, to = rng.uniform(0, 100, (50, 2)), rng.uniform(0, 100, (100, 2))
    values, others = rng.normal(size=(2, 50))
    together = Cokriging(observed(model, (at, values), (at, others)), model)
    alone = krige(
        at, values, to, CovarianceModel(kind="exponential", sill=1.0, range_m=30.0, nugget=0.0)
    )
    mean, variance = together.estimate(to, 0)
    assert np.allclose(mean, alone.mean, atol=1e-5)
    assert np.allclose(variance, alone.variance, atol=1e-5)


def test_a_quantity_without_values_is_refused_and_no_covariance_either():
    with pytest.raises(ValueError, match="not a covariance"):
        Coregionalisation(
            kind="exponential",
            sills=(np.array([[1.0, 2.0], [2.0, 1.0]]),),
            ranges_m=(3.0,),
            nuggets=np.zeros(2),
        )
    model = Coregionalisation(
        kind="exponential", sills=(np.eye(2),), ranges_m=(3.0,), nuggets=np.ones(2)
    )
    at = np.arange(6.0).reshape(3, 2)
    solved = Cokriging(observed(model, (at, np.ones(3))), model)
    with pytest.raises(ValueError, match="needs a value of the quantity"):
        solved.estimate(at, 1)


def test_the_practical_range_is_where_a_twentieth_is_left():
    model = Coregionalisation(
        kind="exponential",
        sills=(np.diag([1.0, 0.0]), np.diag([3.0, 1.0])),
        ranges_m=(10.0, 80.0),
        nuggets=np.zeros(2),
    )
    reach = model.practical_range_m(0)
    assert model.covariance(0, np.array([reach]))[0] == pytest.approx(0.05 * 4.0)
    assert model.practical_range_m(1) == pytest.approx(80 * np.log(20))
