"""The image for a boat's companion, as far as it can be checked without building it."""

import fnmatch
import importlib.util
import json
import re
import subprocess
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DOCKERFILE = (ROOT / "deploy" / "Dockerfile").read_text()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
# What a boat has no use for.
FOR_DEVELOPERS = {"dev", "docs", "bench", "peers"}
# A boat serves no page and simulates no campaign.
ASHORE = {"app", "campaign", "dask"}


def instructions():
    """The instructions of the image's last stage: pairs of their name and their text."""
    joined = DOCKERFILE.replace("\\\n", "")
    lines = [line for line in joined.splitlines() if line and not line.startswith("#")]
    pairs = [tuple(line.split(maxsplit=1)) for line in lines]
    last = max(i for i, (name, _) in enumerate(pairs) if name == "FROM")
    return pairs[last:]


def labels():
    """The labels by name, as Docker reads them: what stands in quotes."""
    found = (re.fullmatch(r"(\w+)=(['\"])(.*)\2", text) for name, text in instructions()
             if name == "LABEL")  # fmt: skip
    return {one[1]: one[3] for one in found}


def test_the_image_installs_every_extra_that_a_boat_may_need_and_no_other():
    named = re.findall(r"'\.\[([\w,-]+)\]'", DOCKERFILE)
    assert len(named) == 1
    assert set(named[0].split(",")) == (
        set(PROJECT["optional-dependencies"]) - FOR_DEVELOPERS - ASHORE
    )


def test_it_runs_as_nobody_special_and_opens_no_port():
    names = [name for name, _ in instructions()]
    assert "EXPOSE" not in names
    assert [text for name, text in instructions() if name == "USER"] == ["grebe"]
    assert ("VOLUME", "/data") in instructions()
    permissions = json.loads(labels()["permissions"])["HostConfig"]
    assert set(permissions) == {"Binds", "ExtraHosts"}
    assert permissions["Binds"] == ["/usr/blueos/userdata/grebe:/data"]


def test_the_labels_are_what_blueos_reads():
    read = labels()
    for name in ("permissions", "authors", "company", "links", "tags"):
        json.loads(read[name])
    assert {"version", "type", "requirements"} <= set(read)
    assert read["version"] == PROJECT["version"]


def test_what_the_image_copies_is_there_and_let_through():
    allowed = [
        line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line[:1] == "!"
    ]
    copied = re.findall(r"^COPY (?!--from)(?:--\S+ )*(.+) \S+$", DOCKERFILE, re.MULTILINE)
    for source in " ".join(copied).split():
        assert (ROOT / source).exists()
        assert any(fnmatch.fnmatch(source, one) for one in allowed), source


def test_the_entrypoint_is_a_shell_script_that_can_be_run():
    script = ROOT / "deploy" / "entrypoint.sh"
    assert script.stat().st_mode & 0o111
    subprocess.run(["sh", "-n", script], check=True)


def test_the_check_for_arm64_asks_about_the_image_s_extras():
    spec = importlib.util.spec_from_file_location("tool", ROOT / "tools" / "check_arm64.py")
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    assert set(tool.installed_extras()) <= set(PROJECT["optional-dependencies"])
    assert tool.installed_extras()
