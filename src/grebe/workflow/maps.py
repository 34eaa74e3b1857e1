"""Map a survey, and write the maps in every format."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from grebe.core.errors import InputError
from grebe.core.quantity import inline
from grebe.core.samples import Samples
from grebe.core.survey import Survey
from grebe.io.export.catalogue import CatalogueEntry
from grebe.io.export.contours import write_contours
from grebe.io.export.geotiff import affine, write_geotiff
from grebe.io.export.netcdf import write_netcdf
from grebe.io.export.netcdf_movie import write_movie_netcdf
from grebe.io.export.stac import ITEM_NAME, Asset, write_stac_item
from grebe.io.readers.credits import read_credits
from grebe.io.store import SurveyFile
from grebe.mapping.grid import DEFAULT_NODES
from grebe.mapping.maps import Each, MapSettings, in_turn
from grebe.mapping.quantity_map import QuantityMap
from grebe.mapping.stamps import usual_step_s
from grebe.report import canvas, map_figures
from grebe.report.bathymetry import bathymetry_of, hypsographic_figure, write_hypsography
from grebe.report.data import ReportData, gather
from grebe.report.movie_figures import movie_figure
from grebe.report.texts import texts_of
from grebe.report.thresholds import Profile
from grebe.workflow.files import make_folder
from grebe.workflow.helpers import idle_cores

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

NETCDF_NAME, MOVIE_NAME = "map.nc", "movie.nc"
# A second process takes a second to begin: it is worth it from so many samples times quantities on.
# Each process holds the complete survey, so larger surveys get no second one.
LEAST_WORK, MOST_SAMPLES, MOST_NODES = 2_000, 100_000, 500_000


def map_survey(
    file: Path,
    settings: MapSettings | None = None,
    resolution_m: float | None = None,
    on_mapped: Callable[[int, int], None] | None = None,
    every_s: float | None = None,
    each: Each = in_turn,
) -> ReportData:
    """Map every quantity that a survey file has samples of; `maps` holds them in the file's order.

    `on_mapped` is called with the number of quantities done and the total; `each` makes the map of
    each of them. With `every_s` there are `movies` of them too, with a map every so many seconds.
    """
    with SurveyFile.open(file) as survey_file:
        return gather(survey_file, resolution_m, settings, on_mapped, every_s, each)


def helpers_for(
    survey_file: SurveyFile, resolution_m: float | None = None, workers: int | None = None
) -> int:
    """Return how many processes beside this one the maps of a survey are worth.

    `workers` states the total, this process included. Otherwise the result is 0 if there is little
    to do, or if each process would need much memory.
    """
    several = sum(one.mapped for one in survey_file.quantities.values())
    if workers is not None:
        return max(min(workers, several) - 1, 0)
    nodes = survey_file.survey.water.area / resolution_m**2 if resolution_m else DEFAULT_NODES
    if survey_file.count("samples") * several < LEAST_WORK or nodes > MOST_NODES:
        return 0
    if survey_file.count("samples") > MOST_SAMPLES:
        return 0
    return max(min(idle_cores(), several - 1), 0)


def write_maps(
    data: ReportData,
    out: Path,
    profile: Profile,
    draws: int = 0,
    credits_file: Path | None = None,
    each: Each = in_turn,
) -> list[Path]:
    """Write the maps in every format and return the files; `InputError` if there are none.

    `credits_file` says who made the survey, and on what terms. `each` writes the raster and the
    pictures of each map.
    """
    if not data.maps:
        raise InputError(f"No quantity can be mapped: {'; '.join(data.left_out)}.")
    entry = catalogue_entry(data, credits_file)
    make_folder(out)
    frame = data.survey.frame
    concerns = {
        one.quantity.key: {each.name: each.probability(one) for each in profile.of(one)}
        for one in data.maps
    }
    drawn: dict[str, NDArray[np.floating]] = {
        one.quantity.key: one.draws(draws) for one in data.maps if draws
    }
    written = [out / NETCDF_NAME, out / "contours.gpkg"]
    write_contours(written[1], data.maps, frame)
    write = _OneWritten(
        survey=data.survey, samples=data.samples, out=out, simulated=data.is_simulated
    )
    for files in each(write, [(one, concerns[one.quantity.key]) for one in data.maps]):
        written += files
    for earlier in (out / MOVIE_NAME, *out.glob("*_movie.png")):
        earlier.unlink(missing_ok=True)
    written += _write_movies(data, out, entry)
    write_stac_item(out / ITEM_NAME, entry, _assets(data, written, concerns), _projection(data))
    # Written last: its presence means that the maps are complete.
    write_netcdf(written[0], data.maps, frame, entry, concerns, drawn)
    return [*written, out / ITEM_NAME]


@dataclass(frozen=True, kw_only=True, eq=False)
class _OneWritten:
    """A callable that writes the raster and the pictures of one map to the folder `out`.

    It takes a map and its probabilities of concern by name, and returns the files.
    """

    survey: Survey
    samples: Samples
    out: Path
    simulated: bool

    def __call__(self, item: tuple[QuantityMap, Mapping[str, Array]]) -> list[Path]:
        one, concerns = item
        raster, picture = (self.out / f"{one.quantity.key}.{end}" for end in ("tif", "png"))
        write_geotiff(raster, one, self.survey.frame, concerns)
        canvas.save(
            map_figures.map_figure(self.survey, one, self.samples, simulated=self.simulated),
            picture,
        )
        lake = bathymetry_of(one, self.survey)
        if lake is None:
            return [raster, picture]
        table, curve = self.out / "hypsography.csv", self.out / "hypsography.png"
        write_hypsography(table, lake)
        canvas.save(hypsographic_figure(lake), curve)
        return [raster, picture, table, curve]


def _write_movies(data: ReportData, out: Path, entry: CatalogueEntry) -> list[Path]:
    if not data.movies:
        return []
    written = [out / MOVIE_NAME]
    write_movie_netcdf(written[0], data.movies, data.survey.frame, entry)
    for one in data.movies:
        path = out / f"{one.still.quantity.key}_movie.png"
        canvas.save(movie_figure(data.survey, one, texts_of("en")), path)
        written.append(path)
    return written


def movie_note(data: ReportData) -> str | None:
    """Return a sentence on why some maps have no movie.

    None if each has one or none was requested.
    """
    if data.movies is None or not data.still:
        return None
    still = ", ".join(inline(one.label) for one in data.still)
    return (
        f"no movie of {still}: the samples do not show that the water changed during the survey, "
        "so its map would be the same at every moment"
    )


def _assets(
    data: ReportData, written: Sequence[Path], concerns: Mapping[str, Mapping[str, object]]
) -> list[Asset]:
    """Return the files of a set of maps as assets, with the bands of the rasters."""
    titles = {
        "map": "all quantities",
        "movie": "what changed, moment by moment",
        "contours": "contours",
        "hypsography": "hypsography",
    }
    by_key = {one.quantity.key: one.quantity for one in data.maps}
    ends = {one.quantity.key: tuple(one.interval95) for one in data.maps}
    made: list[Asset] = []
    for path in written:
        quantity = by_key.get(path.stem)
        bands: list[tuple[str, str]] = []
        if quantity is not None and path.suffix == ".tif":
            unit = quantity.unit
            bands = [(name, unit) for name in ("mean", "sd", *ends[path.stem])]
            bands += [(name, "1") for name in concerns[path.stem]]
        filmed = by_key.get(path.stem.removesuffix("_movie"))
        title = quantity.label if quantity else titles.get(path.stem, path.stem)
        if filmed is not None and quantity is None:
            title = f"{filmed.label}, moment by moment"
        made.append(Asset(path=path, title=title, bands=bands))
    return made


def _projection(data: ReportData) -> dict[str, Any]:
    """Return the properties that all rasters share, by STAC's projection extension."""
    from pyproj import CRS

    grid = data.maps[0].grid
    return {
        "proj:code": None,
        "proj:wkt2": CRS.from_user_input(data.survey.frame.definition).to_wkt(),
        "proj:shape": [len(grid.north), len(grid.east)],
        "proj:transform": list(affine(grid)),
    }


def catalogue_entry(data: ReportData, credits_file: Path | None = None) -> CatalogueEntry:
    """Return the catalogue entry of the maps; `InputError` if the credits cannot be read."""
    said = read_credits(credits_file).said()
    water = shapely.transform(data.survey.water, data.survey.frame.to_wgs84)
    times = data.samples.times
    return CatalogueEntry(
        title=said.get(
            "title",
            f"{'Simulated' if data.is_simulated else 'Surface'} water of {data.survey.name}",
        ),
        identifier=data.meta.get("survey_id", ""),
        outline=water,
        quantities=[one.quantity.label for one in data.maps],
        resolution_m=data.maps[0].grid.step_m,
        created_s=datetime.now(UTC).timestamp(),
        first_s=float(times.min()),
        last_s=float(times.max()),
        every_s=usual_step_s(times),
        source=f"Grebe {data.meta['software_version']}, {data.meta.get('water', 'measured')}",
        history=f"mapped from survey {data.meta.get('survey_id', '')}",
        comment=data.meta.get("note", ""),
        credits=said,
        simulated=data.is_simulated,
    )


def _change_numbers(one: QuantityMap) -> dict[str, Any]:
    change, response = one.change, one.change.response
    unseen = change.unseen_sd
    return {
        "moment": datetime.fromtimestamp(change.moment_s, UTC).isoformat()
        if one.is_of_moment
        else None,
        "during_survey": one.changed_by if change.is_significant else None,
        "log_likelihood_gain": change.gain,
        "unseen_sd_at_most": one.in_unit(unseen) if np.isfinite(unseen) else None,
        "sensor_lag_s": change.lag_s or None,
        "lag_log_likelihood_gain": change.lag_gain,
        "sensor_response": vars(response) if response else None,
    }


def map_numbers(one: QuantityMap) -> dict[str, Any]:
    """Return the numbers of a map, for JSON."""
    model, validation = one.model, one.validation
    return {
        "quantity": one.quantity.key,
        "samples": one.samples,
        "flagged": one.flagged,
        "method": one.method.key,
        "reason": one.reason,
        "scale": one.scale.name,
        "sd_factors": {
            "on_way": one.calibration.on_way,
            "off_way": one.calibration.off_way,
            "by_place": one.calibration.unrest is not None,
        },
        "variogram": {
            "kind": model.kind,
            "nugget": model.nugget,
            "partial_sill": model.sill,
            "range_m": model.range_m,
            "practical_range_m": model.practical_range_m,
            "reason": model.reason,
            "standard_errors": {
                name: value if np.isfinite(value) else None
                for name, value in model.standard_errors.items()
            },
        },
        "together": vars(model.companions) if model.companions else None,
        "change": _change_numbers(one),
        "validation": vars(validation) if validation else None,
    }
