"""Option types that several commands share."""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from grebe.core.dynamics import Weather
from grebe.core.errors import InputError, UsageError
from grebe.core.frames import LocalFrame

if TYPE_CHECKING:
    from grebe.io.readers.track import TrackColumns

EXISTING = click.Path(path_type=Path)
OUTPUT = click.Path(path_type=Path, dir_okay=False)
FOLDER = click.Path(path_type=Path, file_okay=False)


class Pair(click.ParamType):
    """Two numbers with a separator: LON,LAT or LO:HI."""

    def __init__(self, first: str, second: str, separator: str = ",") -> None:
        self.name = f"{first}{separator}{second}"
        self._separator = separator

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """Return the placeholder that the help shows."""
        return self.name

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float]:
        """Parse; anything but two finite numbers is a usage error."""
        if isinstance(value, tuple):
            return value
        parts = str(value).split(self._separator)
        try:
            first, second = (float(part) for part in parts)
        except ValueError:
            self.fail(f"{value!r} is not of the form {self.name}.", param, ctx)
        if not (math.isfinite(first) and math.isfinite(second)):
            self.fail(f"{value!r} contains a number that is not finite.", param, ctx)
        return first, second


class Minutes(click.ParamType):
    """A time in minutes, as seconds."""

    name = "MINUTES"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Parse; anything but a number above 0 is a usage error."""
        try:
            minutes = float(value)
        except ValueError:
            minutes = math.nan
        if not (math.isfinite(minutes) and minutes > 0):
            self.fail(f"{value!r} is not a number of minutes above 0.", param, ctx)
        return 60.0 * minutes


class Moment(click.ParamType):
    """A time in ISO 8601 as unix seconds, UTC unless it names a zone; or the word middle."""

    name = "TIME|middle"

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """Return the placeholder that the help shows, with `middle` as it has to be written."""
        return self.name

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float | str:
        """Parse; anything else is a usage error."""
        if value == "middle" or isinstance(value, float):
            return value
        try:
            moment = datetime.fromisoformat(str(value))
        except ValueError:
            said = f"{value!r} is neither a time such as 2026-05-01T12:00Z nor 'middle'."
            self.fail(said, param, ctx)
        return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


MOMENT = Moment()
LON_LAT = Pair("LON", "LAT")
NORTH_EAST = Pair("NORTH", "EAST")
SPEED_WINDOW = Pair("LO", "HI", ":")


def weather_of(current: tuple[float, float], wind: tuple[float, float]) -> Weather:
    """The weather given by --current [m/s] and --wind [N], both (north, east)."""
    return Weather(
        current_north_mps=current[0],
        current_east_mps=current[1],
        wind_force_north_n=wind[0],
        wind_force_east_n=wind[1],
    )


def place_text(frame: LocalFrame) -> str:
    """A survey's latitude and longitude as text, in which a reader notices swapped coordinates."""
    return f"{frame.origin_lat_deg:.5f} N, {frame.origin_lon_deg:.5f} E"


def refuse_same(given: Path | None, output: Path) -> None:
    """Refuse to overwrite the input file, even with --force."""
    if given is not None and given.exists() and output.exists() and given.samefile(output):
        raise InputError(f"{output} is the file being read; give the output another name.")


def checked_output(path: Path) -> Path:
    """Return the path after checking, before any work, that its folder exists and that it is not a
    folder itself.
    """
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}; create it first.")
    if path.is_dir():
        raise InputError(f"{path} is a folder; give the name of a file.")
    return path


json_option = click.option(
    "--json", "as_json", is_flag=True, help="Print the result as one JSON object."
)
force_option = click.option("--force", is_flag=True, help="Overwrite existing output.")


def together(*several: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Combine several options into one decorator; the help shows them in this order."""

    def added(command: Any) -> Any:
        for option in reversed(several):
            command = option(command)
        return command

    return added


quantities_option = click.option(
    "--quantities",
    "quantities_file",
    type=EXISTING,
    help="TOML file that defines more quantities.  [default: quantities.toml beside the survey, "
    "if it exists]",
)


def column_options(command: Any) -> Any:
    """Add the options that name a track's columns."""
    for name, (_, what) in reversed(COLUMNS.items()):
        command = click.option(f"--{name}-column", help=f"Column of a CSV track: {what}.")(command)
    command = click.option(
        "--column",
        "columns",
        multiple=True,
        metavar="KEY=NAME",
        help="Column of a CSV track: KEY is time, date (if separate), lat, lon or the key of a "
        "quantity.",
    )(command)
    return click.option(
        "--header-from",
        type=EXISTING,
        help="Take the column names from the first row of this file.",
    )(command)


# Columns with an option of their own: the key of each, and what it holds.
COLUMNS = {
    "lat": ("lat", "latitude [deg]"),
    "lon": ("lon", "longitude [deg]"),
    "time": ("time", "time (unix seconds or ISO 8601)"),
    "temperature": ("temperature_degc", "temperature [degC]"),
    "oxygen": ("dissolved_oxygen_mgl", "dissolved oxygen [mg/L]"),
    "ph": ("ph", "pH"),
    "conductivity": ("conductivity_uscm", "conductivity [uS/cm]"),
    "turbidity": ("turbidity_ntu", "turbidity [NTU]"),
}


def track_columns(pairs: tuple[str, ...], named: dict[str, Any]) -> TrackColumns:
    """A track's column names by key, from the --column KEY=NAME `pairs` and from the options such
    as --lat-column in `named`.
    """
    columns = {
        key: named[f"{option}_column"]
        for option, (key, _) in COLUMNS.items()
        if named[f"{option}_column"] is not None
    }
    for pair in pairs:
        key, equals, name = pair.partition("=")
        if not equals or not name:
            raise UsageError(f"--column {pair!r} is not KEY=NAME.")
        columns[key.strip()] = name
    return columns
