"""Map many surveys on the engine of campaigns: one's failure is told, and the others go on."""

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
    """What came of one survey: its maps' labels, what was left out, and what was written; or the
    `error` that kept it from being mapped. `known`: it had been mapped before.
    """

    file: Path
    folder: Path
    maps: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    error: str = ""
    known: bool = False


@dataclass(frozen=True, kw_only=True)
class MapTask:
    """Called with a survey file it writes its maps to a folder of its own below `out`."""

    out: Path
    settings: MapSettings
    resolution_m: float | None = None
    draws: int = 0
    profile: Path | None = None
    credits_file: Path | None = None
    every_s: float | None = None

    def folder_of(self, file: Path) -> Path:
        """Where the maps of a survey file go."""
        return self.out / file.stem

    def __call__(self, file: Path) -> Mapped:
        """Map one survey; an error is a value, for the others are not to suffer from it."""
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
    """Map surveys and return what came of each, in the order of `files`.

    One whose maps are there already is passed over unless by `force`: a call that was cut off is
    gone on with by calling again.
    """
    folders = [task.folder_of(file) for file in files]
    for file, folder in zip(files, folders, strict=True):
        if folders.count(folder) > 1:
            raise UsageError(
                f"Two of the survey files are called {file.stem}, and both would be mapped to "
                f"{folder}; map them one by one, or give one another name."
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
