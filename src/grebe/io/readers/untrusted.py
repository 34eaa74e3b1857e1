"""Refuse files that would do harm: too large, bombs, nested beyond reason.

Everything here is decided before a parser sees the file, or by one that counts as it goes.
"""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from xml.parsers import expat

from grebe.core.errors import InputError

LARGEST_BYTES = 50_000_000
LARGEST_UNPACKED_BYTES = 100_000_000
MOST_MEMBERS = 1_000
DEEPEST_XML = 60
_CHUNK = 1 << 16
_WANTED = (".kml", ".shp", ".gpkg", ".gpx", ".geojson")


def check_size(path: Path) -> None:
    """Refuse a file that is empty, or larger than any outline."""
    size = path.stat().st_size
    if size == 0:
        raise InputError(f"{path}: the file is empty.")
    if size > LARGEST_BYTES:
        raise InputError(
            f"{path}: {size / 1e6:.0f} MB is more than an outline takes "
            f"(at most {LARGEST_BYTES / 1e6:.0f} MB); simplify it first."
        )


def check_xml(path: Path) -> None:
    """Refuse XML that declares a document type, is nested beyond reason, or is not well formed."""
    parser = expat.ParserCreate()
    depth = 0

    def start(*_: object) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST_XML:
            raise InputError(f"{path}: nested more than {DEEPEST_XML} deep, as no outline is.")

    def end(*_: object) -> None:
        nonlocal depth
        depth -= 1

    def doctype(*_: object) -> None:
        raise InputError(f"{path}: declares a document type, which no KML or GPX needs; refused.")

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = doctype
    try:
        with path.open("rb") as file:
            parser.ParseFile(file)
    except expat.ExpatError as error:
        raise InputError(f"{path}: not well-formed XML ({error}).") from None


@contextmanager
def unpacked(path: Path) -> Generator[Path]:
    """Yield the file to read: itself, or what a KMZ or a zipped Shapefile holds.

    Archives are unpacked into a temporary folder, and never beyond `LARGEST_UNPACKED_BYTES`.
    """
    if path.suffix.lower() not in (".kmz", ".zip"):
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="grebe-") as folder:
        try:
            with zipfile.ZipFile(path) as archive:
                yield _extracted(path, archive, Path(folder))
        except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError) as error:
            raise InputError(f"{path}: not a sound zip archive ({error}).") from None


def _extracted(path: Path, archive: zipfile.ZipFile, folder: Path) -> Path:
    members = [member for member in archive.infolist() if not member.is_dir()]
    if len(members) > MOST_MEMBERS:
        raise InputError(f"{path}: holds {len(members)} files; an outline has only a few.")
    left = LARGEST_UNPACKED_BYTES
    for member in members:
        # Only the name, without folders: an archive must not write outside its own folder.
        target = folder / Path(member.filename).name
        with archive.open(member) as source, target.open("wb") as sink:
            while chunk := source.read(_CHUNK):
                left -= len(chunk)
                if left < 0:
                    raise InputError(
                        f"{path}: unpacks to more than {LARGEST_UNPACKED_BYTES / 1e6:.0f} MB; "
                        "no outline does."
                    )
                sink.write(chunk)
    for suffix in _WANTED:
        found = sorted(p for p in folder.iterdir() if p.suffix.lower() == suffix)
        if found:
            return found[0]
    raise InputError(f"{path}: holds no outline (none of {', '.join(_WANTED)}).")
