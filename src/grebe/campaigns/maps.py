"""Map many surveys on a campaign's engine: a failure is reported, and the other surveys go on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from grebe.campaigns.engine import Engine
from grebe.core.errors import GrebeError, UsageError
from grebe.core.quantities import BUILTIN
from grebe.io.store import SurveyFile
from grebe.mapping.maps import MapSettings
from grebe.report.thresholds import read_profile
from grebe.workflow.maps import NETCDF_NAME, map_survey, write_maps


@dataclass(frozen=True, kw_only=True)
class Mapped:
    """The result of one survey: the labels of its maps in `folder` and what was left out, or the
    `error` that prevented them. `known`: it had been mapped before.
    """

    file: Path
    folder: Path
    maps: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    error: str = ""
    known: bool = False


@dataclass(frozen=True, kw_only=True)
class MapTask:
    """Called with a survey file, it writes the maps to a folder of their own below `out`."""

    out: Path
    settings: MapSettings
    resolution_m: float | None = None
    draws: int = 0
    profile: Path | None = None
    credits_file: Path | None = None
    every_s: float | None = None

    def folder_of(self, file: Path) -> Path:
        """The folder for the maps of a survey file."""
        return self.out / file.stem

    def __call__(self, file: Path) -> Mapped:
        """Map one survey; an error is returned as a value, so that other surveys go on."""
        folder = self.folder_of(file)
        try:
            with SurveyFile.open(file) as survey_file:
                profile = read_profile(self.profile, BUILTIN.extended(survey_file.quantities))
            data = map_survey(file, self.settings, self.resolution_m, every_s=self.every_s)
            write_maps(data, folder, profile, self.draws, self.credits_file)
        except GrebeError as error:
            return Mapped(file=file, folder=folder, error=str(error))
        labels = tuple(f"{one.quantity.label} ({one.method.key})" for one in data.maps)
        return Mapped(file=file, folder=folder, maps=labels, left_out=tuple(data.left_out))


def map_many(
    files: Sequence[Path],
    task: MapTask,
    engine: Engine,
    *,
    force: bool = False,
    watch: Callable[[int, int], None] = lambda _done, _of: None,
) -> list[Mapped]:
    """Map surveys and return the result of each, in the order of `files`.

    Surveys whose maps exist already are skipped, unless `force` is given: to continue after an
    interruption, call it again. Raises `UsageError` when two files would be mapped to one folder.
    """
    folders = [task.folder_of(file) for file in files]
    for file, folder in zip(files, folders, strict=True):
        if folders.count(folder) > 1:
            raise UsageError(
                f"Two of the survey files are called {file.stem}, and both would be mapped to "
                f"{folder}; map them one by one, or rename one."
            )
    done = {
        file: Mapped(file=file, folder=folder, known=True)
        for file, folder in zip(files, folders, strict=True)
        if (folder / NETCDF_NAME).exists() and not force
    }
    for file, mapped in engine.results(task, [file for file in files if file not in done]):
        done[file] = mapped
        watch(len(done), len(files))
    return [done[file] for file in files]
