"""The paper's figures of a hand-driven survey: its track, its map, and a planned path."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely
from scipy.spatial import KDTree

from grebe.core.errors import InputError
from grebe.core.plan_settings import PlanSettings
from grebe.core.quantities import BUILTIN
from grebe.core.samples import Flag
from grebe.core.vessel import vessel_named
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper
from grebe.mapping.quantity_map import QuantityMap
from grebe.paper import drawings
from grebe.paper.checks import Check, Reproduction
from grebe.paper.hand_driven import HandDriven
from grebe.planning.planner import plan
from grebe.report.canvas import save

OXYGEN = "dissolved_oxygen_mgl"
FIG6_CELL_M = 10.0


def fig4(out: Path, hand: HandDriven) -> Reproduction:
    """The trajectory of the hand-operated vessel in decimal coordinates: irregular, with gaps."""
    grid = make_grid(hand.survey.water)
    away, _ = KDTree(hand.positions).query(grid.nodes)
    ring = shapely.convex_hull(shapely.multipoints(hand.raw.lonlat))
    picture = save(drawings.hand_track(hand.raw.lonlat, ring), out / "fig4.png")
    return Reproduction(
        figure="fig4",
        picture=picture,
        checks=(
            Check(
                what="region, the convex hull of all samples",
                found=f"{hand.survey.water.area / 1e4:.2f} ha, {len(hand.positions)} samples",
                holds=bool(shapely.covers(ring, shapely.points(hand.raw.lonlat)).all()),
            ),
            Check(
                what="farthest place of the region from any sample: what was left out",
                found=f"{away.max():.0f} m, and {np.mean(away > 10):.0%} of it beyond 10 m",
                holds=bool(away.max() > 10),
            ),
        ),
    )


def fig5(out: Path, hand: HandDriven) -> Reproduction:
    """The geostatistical map of dissolved oxygen from the hand-operated samples."""
    quantity = BUILTIN[OXYGEN]
    if OXYGEN not in hand.raw.values:
        raise InputError(f"{hand.survey.name} has no dissolved oxygen, which Fig. 5 shows.")
    one = _mapped(hand, quantity.key)
    picture = save(drawings.quantity_map(hand.survey, one), out / "fig5.png")
    proof = one.validation
    assert proof is not None
    return Reproduction(
        figure="fig5",
        picture=picture,
        checks=(
            Check(
                what="the map covers the region",
                found=f"{int(one.grid.inside.sum())} nodes, {np.nanmin(one.mean):.2f} to "
                f"{np.nanmax(one.mean):.2f} {quantity.unit}",
                holds=bool(np.isfinite(one.mean[one.grid.inside]).all()),
            ),
            Check(
                what="error at lines of the track that were left out, against the nearest sample's",
                found=f"{proof.rmse:.3f} and {proof.nearest_rmse:.3f} {quantity.unit}",
                holds=proof.rmse < proof.nearest_rmse,
            ),
        ),
    )


def fig6(out: Path, hand: HandDriven) -> Reproduction:
    """A regular plan through squares of 100 m2 over the region, in rows, back and forth."""
    settings = PlanSettings(cell_m=FIG6_CELL_M, pattern="rows")
    planned = plan(hand.region, vessel_named("spyboat"), settings)
    picture = save(drawings.planned(planned.survey), out / "fig6.png")
    cells = [t for t in planned.survey.targets if t.kind == "cell"]
    whole = sum(abs(t.set.polygon.area - FIG6_CELL_M**2) < 1e-6 for t in cells)
    return Reproduction(
        figure="fig6",
        picture=picture,
        checks=(
            Check(
                what="squares of 100 m2 among the cells",
                found=f"{whole} of {len(cells)}, the others cut by the region's edge",
                holds=whole > len(cells) / 2,
            ),
            Check(
                what="the region within the cells",
                found=f"{planned.check.coverage:.2%}",
                holds=planned.check.coverage > 0.97,
            ),
            Check(
                what="length of the route over a lower bound",
                found=f"{1 + planned.outcome.gap:.3f}",
                holds=planned.outcome.gap < 0.1,
            ),
        ),
    )


def _mapped(hand: HandDriven, key: str) -> QuantityMap:
    quantity = BUILTIN[key]
    values = hand.good[key]
    flags = np.where(np.isfinite(values), Flag.GOOD, Flag.MISSING)
    mapper = Mapper(hand.survey.water, make_grid(hand.survey.water))
    return mapper.map_quantity(quantity, hand.positions, values, flags)


HAND_FIGURES = {"fig4": fig4, "fig5": fig5, "fig6": fig6}
