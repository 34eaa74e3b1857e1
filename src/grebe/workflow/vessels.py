"""Vessels as users name them: a preset, or a TOML file of their own boat."""

from __future__ import annotations

from pathlib import Path

from grebe.core.vessel import Vessel, vessel_named
from grebe.io.readers.vessel import read_vessel


def vessel_of(text: str) -> Vessel:
    """Return the preset of that name, or the vessel of a file that ends in .toml."""
    return read_vessel(Path(text)) if text.lower().endswith(".toml") else vessel_named(text)
