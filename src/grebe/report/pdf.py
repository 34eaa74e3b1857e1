"""A page as PDF, printed by an installed browser."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

from grebe.core.errors import InputError
from grebe.io.atomic_write import written_whole

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
LONGEST_S = 120


def print_pdf(page: Path, path: Path) -> None:
    """Print an HTML file to `path`. Raises `InputError` if no browser is found or it fails."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        raise InputError(
            f"No browser was found to print {path} with (looked for {', '.join(BROWSERS)}); open "
            f"{page} in yours and print it."
        )
    with tempfile.TemporaryDirectory() as profile:
        printed = Path(profile) / "page.pdf"
        command = [
            browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer",
            f"--user-data-dir={profile}", f"--print-to-pdf={printed}", page.resolve().as_uri(),
        ]  # fmt: skip
        try:
            done = subprocess.run(command, capture_output=True, timeout=LONGEST_S, check=False)
        except subprocess.TimeoutExpired:
            raise InputError(f"{browser} did not print {page} within {LONGEST_S} s.") from None
        if done.returncode != 0 or not printed.exists():
            last = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
            raise InputError(f"{browser} could not print {page}: {' '.join(last)[:200]}.")
        with written_whole(path) as part:
            shutil.copyfile(printed, part)
