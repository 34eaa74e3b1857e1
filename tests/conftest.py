"""What the tests share: real data where it lies beside the checkout, and small surveys."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, assume, settings
from hypothesis import strategies as st

from grebe.control.rules.lookahead import Lookahead
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings
from grebe.core.quantities import LIMNOLOGICAL
from grebe.core.sets import TargetSet
from grebe.core.survey import Survey
from grebe.core.vessel import PRESETS
from grebe.io.export.catalogue import CatalogueEntry
from grebe.io.store import SurveyFile
from grebe.planning.planner import plan_survey
from grebe.planning.region import Region
from grebe.server.mission_delta import MissionDelta
from grebe.workflow.demo import HERON, OUTLINE_M
from grebe.workflow.files import write_survey
from grebe.workflow.run import run_survey, steered_by
from grebe.workflow.simulated import SimulatedWorld

settings.register_profile(
    "grebe", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("grebe")

# One browser a worker, whichever files ask for it: a second could not be driven beside it.
pytest_plugins = ["app.browser"]

DATA = Path(
    os.environ.get("GREBE_TEST_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")
)
TRACKS = DATA / "tracks"
CHINA = TRACKS / "China-catabot-20200915.csv"
TEMPERATURE, OXYGEN = LIMNOLOGICAL["temperature_degc"], LIMNOLOGICAL["dissolved_oxygen_mgl"]
FRAME = LocalFrame(origin_lon_deg=3.171153, origin_lat_deg=50.636268)
NOON = datetime(2026, 5, 1, 12, 0, tzinfo=UTC)
ENTRY = CatalogueEntry(
    title="Surface water of a test",
    identifier="4f1b",
    outline=shapely.box(3.17, 50.63, 3.18, 50.64),
    quantities=("Dissolved oxygen",),
    resolution_m=2.5,
    created_s=NOON.timestamp() + 86_400,
    first_s=NOON.timestamp(),
    last_s=NOON.timestamp() + 3_600,
    every_s=1.0,
    source="a test",
    history="made up",
)


def pytest_collection_modifyitems(items):
    """Files with slow tests go first, so that no worker is left alone with one at the end.

    The second of two workers begins in the middle: there stand slow files of maps, which sail no
    boat, so that it has work while the first compiles the controller's kernels.
    """
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)
    ashore = [item for item in items if item.path in slow and item.path.parent.name == "mapping"]
    others = [item for item in items if item not in ashore]
    middle = len(items) // 2
    items[:] = [*others[:middle], *ashore, *others[middle:]]


def run_simulated(file, rule=None, world=None, **how):
    """Run the mission of a survey file in a simulated world."""
    helm = steered_by(rule or Lookahead())
    return run_survey(file, world or SimulatedWorld(), helm, NOON, **how)


REAL_DATA = {"real tracks": CHINA, "real outlines": DATA / "regions"}
MISSING = [f"the {what} are not at {path}" for what, path in REAL_DATA.items() if not path.exists()]


def _needs(what: str) -> pytest.MarkDecorator:
    path = REAL_DATA[what]
    return pytest.mark.skipif(not path.exists(), reason=f"the {what} are not at {path}")


needs_tracks, needs_outlines = _needs("real tracks"), _needs("real outlines")


def pytest_terminal_summary(terminalreporter):
    """Say at the end of every run which real data were missing, whatever the verbosity."""
    for missing in MISSING:
        terminalreporter.write_line(f"tests skipped: {missing}; set GREBE_TEST_DATA", yellow=True)


def region_of(corners: list[tuple[float, float]]) -> Region:
    return Region(name="test water", frame=FRAME, water=shapely.Polygon(corners))


def square_survey(side_m: float = 20.0, cell_m: float = 10.0) -> Survey:
    region = region_of([(0, 0), (side_m, 0), (side_m, side_m), (0, side_m)])
    return plan_survey(region, PRESETS["spyboat"], PlanSettings(cell_m=cell_m))


@st.composite
def convex_polygons(draw: st.DrawFn, scale: float = 50.0) -> shapely.Polygon:
    """Convex polygons with some area, from points on an ellipse."""
    count = draw(st.integers(3, 8))
    angles = sorted(
        draw(st.lists(st.floats(0, 2 * np.pi - 0.1), min_size=count, max_size=count, unique=True))
    )
    a = draw(st.floats(0.2 * scale, scale))
    b = draw(st.floats(0.2 * scale, scale))
    points = [(round(a * np.cos(t), 6), round(b * np.sin(t), 6)) for t in angles]
    polygon = shapely.Polygon(points).convex_hull.simplify(1e-3).convex_hull
    assume(isinstance(polygon, shapely.Polygon) and polygon.area > 0.05 * a * b)
    assume(polygon.area / polygon.length > 0.02 * scale)
    return polygon


@st.composite
def target_sets(draw: st.DrawFn) -> TargetSet:
    polygon = draw(convex_polygons())
    low = draw(st.floats(0.0, 1.0))
    return TargetSet(
        vertices=tuple((x, y) for x, y in polygon.exterior.coords[:-1]),
        speed_min_mps=low,
        speed_max_mps=low + draw(st.floats(0.2, 2.0)),
    )


def states(reach: float = 100.0) -> st.SearchStrategy[tuple[float, ...]]:
    place = st.floats(-reach, reach)
    return st.tuples(
        place, place, st.floats(-7, 7), st.floats(-1, 3), st.floats(-1, 1), st.floats(-1, 1)
    )


@pytest.fixture
def coarse_survey(tmp_path):
    """The file of a survey in so few and small targets that much is left to measure."""
    path = tmp_path / "s.gpkg"
    region = region_of([(0, 0), (90, 0), (90, 90), (0, 90)])
    settings = PlanSettings(cell_m=30.0, core=0.4, shore_margin_m=3.0)
    write_survey(path, plan_survey(region, PRESETS["spyboat"], settings))
    return path


@pytest.fixture(scope="session")
def simulated_survey(tmp_path_factory):
    """The file of a survey that was sailed, the survey, and what a page was told of it in turn."""
    region = Region(name="Heron", frame=HERON, water=shapely.Polygon(OUTLINE_M))
    survey = plan_survey(region, PRESETS["spyboat"], PlanSettings(cell_m=15.0))
    path = tmp_path_factory.mktemp("told") / "demo.gpkg"
    write_survey(path, survey)
    told = []
    with SurveyFile.open(path) as file:
        delta = MissionDelta(survey, list(file.quantities))

        def on_event(event):
            delta.on_event(event)
            if (one := delta.take()) is not None:
                told.append(one)

        report = run_simulated(file, listeners=[on_event])
    assert report.complete
    return path, survey, told
