"""Check that an arm64 boat can install all packages of the image without a compiler.

    python tools/check_arm64.py

Resolves the extras that `deploy/Dockerfile` names, with the repository's constraints, and queries
the package index for a wheel of each package for Python 3.11 on aarch64. A package without one is
built here from its source, and passes if its wheel is pure Python. Exits with 1 if a package fails.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DOCKERFILE = ROOT / "deploy" / "Dockerfile"
# The platform tags that glibc 2.36 of the image's Debian 12 supports.
PLATFORMS = ["manylinux2014_aarch64", *(f"manylinux_2_{n}_aarch64" for n in range(17, 37))]
PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check"]


def installed_extras() -> list[str]:
    """Return the extras of Grebe that the image installs."""
    found = re.search(r"'\.\[([\w,-]+)\]'", DOCKERFILE.read_text())
    return found[1].split(",") if found else []


def resolved(extras: list[str]) -> list[str]:
    """Return the packages that an installation would take, as NAME==VERSION."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        wanted = f"{ROOT}[{','.join(extras)}]"
        _run(
            "install", "--dry-run", "--ignore-installed", "--quiet", "--report", str(report),
            "-c", str(ROOT / "constraints.txt"), wanted,
        )  # fmt: skip
        found = [one["metadata"] for one in json.loads(report.read_text())["install"]]
    return sorted(f"{m['name']}=={m['version']}" for m in found if m["name"] != "grebe")


def has_wheel(package: str) -> bool:
    """Whether the index has a wheel of a package for the boat's computer."""
    with tempfile.TemporaryDirectory() as folder:
        platforms = [word for name in PLATFORMS for word in ("--platform", name)]
        done = subprocess.run(
            [*PIP, "install", "--dry-run", "--quiet", "--no-deps", "--only-binary=:all:",
             "--python-version", "311", "--implementation", "cp", "--target", folder,
             *platforms, package],
            capture_output=True,
            check=False,
        )  # fmt: skip
    return done.returncode == 0


def is_pure(package: str) -> bool:
    """Whether the source of a package makes a wheel for every platform."""
    with tempfile.TemporaryDirectory() as folder:
        _run("wheel", "--quiet", "--no-deps", "--no-binary", ":all:", "-w", folder, package)
        return all(one.name.endswith("-none-any.whl") for one in Path(folder).glob("*.whl"))


def _run(*words: str) -> None:
    subprocess.run([*PIP, *words], check=True)


def main() -> None:
    """Check and print each package."""
    if sys.version_info[:2] != (3, 11):
        sys.exit("The image has Python 3.11; run this with it, for its packages are resolved here.")
    extras = installed_extras()
    packages = resolved(extras)
    failed: list[str] = []
    for package in packages:
        wheel = has_wheel(package)
        good = wheel or is_pure(package)
        how = "wheel" if wheel else "pure source" if good else "NEEDS A COMPILER"
        print(f"{package:<32} {how}", flush=True)
        failed += [] if good else [package]
    print(f"{len(packages) - len(failed)} of {len(packages)} packages of grebe[{','.join(extras)}]")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
