"""What other people's checkers say of a NetCDF file."""

import json
from pathlib import Path

from compliance_checker.runner import CheckSuite, ComplianceChecker

CREDITS = {
    "creator_name": "Jane Doe",
    "creator_email": "jane@lake.example",
    "creator_url": "https://lake.example",
    "institution": "Lake Institute",
    "project": "Lakes",
    "acknowledgement": "the ferryman",
    "publisher_name": "Lake Institute",
    "publisher_email": "data@lake.example",
    "publisher_url": "https://lake.example/data",
    "license": "CC-BY-4.0",
    "naming_authority": "example.lake",
}
# How deep the sonde hangs is not known.
NOT_KNOWN = (
    "geospatial_vertical_min not present",
    "geospatial_vertical_max not present",
    "geospatial_vertical_positive not present",
    "geospatial_bounds_vertical_crs not present",
)


def told_of(path: Path) -> list[str]:
    """What the checker of ACDD 1.3 misses in a file that the one of CF 1.8 accepts."""
    CheckSuite.load_all_available_checkers()
    cf, acdd = path.with_suffix(".cf.txt"), path.with_suffix(".acdd.json")
    passed, errors = ComplianceChecker.run_checker(
        str(path), ["cf:1.8"], 0, "strict", output_filename=str(cf), output_format="text"
    )
    assert passed, cf.read_text()
    assert not errors
    ComplianceChecker.run_checker(
        str(path), ["acdd:1.3"], 0, "normal", output_filename=str(acdd), output_format="json"
    )
    found = json.loads(acdd.read_text())["acdd:1.3"]
    return [
        text
        for weight in ("high_priorities", "medium_priorities")
        for result in found[weight]
        for text in result["msgs"]
    ]
