"""Check that the page in the package matches its source.

Run it as `python tools/check_web.py`. It exits with 1 if the built page is stale, or if the page's
packages cannot be fetched by the lock file. Without Node it says that it cannot check, which is an
error only in CI.
"""

from __future__ import annotations

import filecmp
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
WEB, BUILT = ROOT / "web", ROOT / "src" / "grebe" / "server" / "static"


def main() -> int:
    """Build the page into a temporary folder and compare."""
    if shutil.which("npm") is None:
        print("The page is not checked: there is no Node here.")
        return 1 if os.environ.get("CI") else 0
    if not (WEB / "node_modules").is_dir():
        fetched = subprocess.run(
            ["npm", "ci"], cwd=WEB, check=False, capture_output=True, text=True
        )
        if fetched.returncode:
            print(f"The page's packages cannot be fetched by its lock file:\n{fetched.stderr}")
            return 1
    with tempfile.TemporaryDirectory() as folder:
        types = ["npx", "tsc", "--noEmit"]
        build = ["npx", "vite", "build", "--outDir", folder, "--logLevel", "warn"]
        for command in (types, build):
            subprocess.run(command, cwd=WEB, check=True)
        fresh = {p.relative_to(folder): p for p in Path(folder).rglob("*") if p.is_file()}
        kept = {p.relative_to(BUILT): p for p in BUILT.rglob("*") if p.is_file()}
        stale = sorted(
            str(name)
            for name in fresh.keys() | kept.keys()
            if name not in fresh
            or name not in kept
            or not filecmp.cmp(fresh[name], kept[name], shallow=False)
        )
    if stale:
        print(f"The built page is stale ({', '.join(stale)}); run npm run build in web.")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
