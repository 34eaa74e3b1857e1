"""A file is written completely or not at all, even on a full disk."""

from __future__ import annotations

import resource
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
import shapely
from conftest import ENTRY, FRAME, OXYGEN, square_survey

from grebe.core.errors import InputError, SurveyFileError
from grebe.core.samples import Flag
from grebe.io.atomic_write import forget_parts, write_text_whole, written_whole
from grebe.io.export.contours import write_contours
from grebe.io.export.geotiff import write_geotiff
from grebe.io.export.netcdf import write_netcdf
from grebe.io.export.route import write_export
from grebe.io.store import SurveyFile
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings
from grebe.mapping.methods.choice import KRIGING
from grebe.mapping.quantity_map import QuantityMap
from grebe.report.canvas import save


@contextmanager
def full_disk(room: int = 1024) -> Generator[None]:
    """Limit files to so many bytes: a writer sees the same as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    # Python ignores SIGXFSZ, so a write fails instead of ending the process.
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture(scope="module")
def one() -> QuantityMap:
    water = shapely.box(0, 0, 100, 100)
    rng = np.random.default_rng(0)
    positions = rng.uniform(0, 100, (150, 2))
    mapper = Mapper(water, make_grid(water, 2.5), MapSettings(method=KRIGING))
    values = 5 + np.sin(positions[:, 0] / 30) + rng.normal(0, 0.05, 150)
    return mapper.map_quantity(OXYGEN, positions, values, np.full(150, Flag.GOOD))


def figure(path: Path) -> None:
    drawn = plt.figure()
    drawn.gca().plot(np.random.default_rng(1).normal(size=500))
    save(drawn, path)
    plt.close(drawn)


WRITERS = {
    "plan.geojson": lambda path, one: write_export(square_survey(), path),
    "plan.waypoints": lambda path, one: write_export(square_survey(side_m=60), path),
    "map.nc": lambda path, one: write_netcdf(path, [one], FRAME, ENTRY),
    "map.tif": lambda path, one: write_geotiff(path, one, FRAME, {}),
    "contours.gpkg": lambda path, one: write_contours(path, [one], FRAME),
    "map.png": lambda path, one: figure(path),
    "survey.gpkg": lambda path, one: SurveyFile.write(path, square_survey(), meta={}, force=True),
    "page.html": lambda path, one: write_text_whole(path, "x" * 9000),
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_leaves_the_older_file_whole_and_no_part(tmp_path, one, name):
    path = tmp_path / name
    WRITERS[name](path, one)  # anything compiled or cached on first use is ready now
    path.write_text("older")
    with full_disk(), pytest.raises(InputError) as failed:
        WRITERS[name](path, one)
    assert str(failed.value).startswith(f"{path} cannot be written: ")
    assert path.read_text() == "older"
    assert list(tmp_path.iterdir()) == [path]
    WRITERS[name](path, one)
    assert path.read_bytes() != b"older"
    assert list(tmp_path.iterdir()) == [path]


class OddError(RuntimeError):
    """An error of a writer's own."""


def test_what_fails_midway_leaves_nothing_and_keeps_its_own_error(tmp_path):
    path = tmp_path / "file.txt"

    def write(failing: BaseException, *known: type[Exception]) -> None:
        with written_whole(path, *known, error=SurveyFileError) as part:
            part.write_text("half")
            raise failing

    with pytest.raises(OddError):
        write(OddError("not the disk's"))
    with pytest.raises(KeyboardInterrupt):
        write(KeyboardInterrupt())
    with pytest.raises(SurveyFileError, match=r"file\.txt cannot be written: the library's"):
        write(OddError("the library's"), OddError)
    assert list(tmp_path.iterdir()) == []


def test_who_ends_a_process_can_remove_what_is_being_written(tmp_path):
    with written_whole(tmp_path / "a.txt") as part:
        part.write_text("half")
        forget_parts()
        assert list(tmp_path.iterdir()) == []
        part.write_text("again, so that the writing ends well")


def test_a_file_is_replaced_and_keeps_its_ending(tmp_path):
    path = tmp_path / "a.txt"
    write_text_whole(path, "older")
    with written_whole(path) as part:
        assert (part.suffix, part.parent) == (path.suffix, path.parent)
        part.write_text("newer")
        assert path.read_text() == "older"
    assert path.read_text() == "newer"
