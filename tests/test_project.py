"""What the project says of itself in several files is the same: versions, dependencies, systems."""

import re
import tomllib
from importlib.metadata import metadata
from pathlib import Path
from urllib.parse import urlsplit

import yaml

from maniport.version import __version__

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
CONDA = {"pin": "pinocchio", "pin-pink": "pink"}
"""What conda-forge calls otherwise."""


def read(name):
    return yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))


def split(requirement):
    name = re.match(r"[\w-]+", requirement)[0]
    return name.lower(), requirement[len(name) :]


def test_the_version_is_the_same_everywhere():
    citation = read("CITATION.cff")
    assert citation["version"] == citation["preferred-citation"]["version"] == __version__
    assert read("conda/recipe.yaml")["context"]["version"] == __version__


def test_the_citation_is_of_the_software_and_refers_to_the_paper():
    citation = read("CITATION.cff")
    preferred = citation["preferred-citation"]
    for key in ("type", "title", "authors", "license", "repository-code", "url"):
        assert preferred[key] == citation[key], key
    assert preferred["type"] == "software"
    assert isinstance(preferred["year"], int)
    (paper,) = citation["references"]
    assert paper["type"] == "conference-paper"
    assert paper["title"] != preferred["title"]
    assert paper["authors"][0]["family-names"] == "Reithmeir"


def test_the_recipe_has_the_dependencies_of_the_package():
    expected = {
        re.sub(r"^[\w-]+", lambda name: CONDA.get(name[0].lower(), name[0].lower()), line).replace(
            " ", ""
        )
        for line in PROJECT["dependencies"]
    }
    listed = {line.replace(" ", "") for line in read("conda/recipe.yaml")["requirements"]["run"]}
    assert {line for line in listed if not line.startswith("python")} == expected


def test_workflows_run_nothing_that_others_can_change():
    for file in (ROOT / ".github" / "workflows").glob("*.yml"):
        used = re.findall(r"uses: (.*)", file.read_text(encoding="utf-8"))
        assert used
        assert [
            action
            for action in used
            if not re.fullmatch(r"[\w./-]+@[0-9a-f]{40}  # v\d+\.\d+\.\d+", action)
        ] == []
        steps = [
            step for job in read(file.relative_to(ROOT))["jobs"].values() for step in job["steps"]
        ]
        assert [step["run"] for step in steps if "${{" in step.get("run", "")] == []


def test_the_notice_has_the_license_of_each_dependency():
    notice = (
        (ROOT / "NOTICE").read_text(encoding="utf-8").partition("Dependencies are not included")[2]
    )
    for name in (re.match(r"[\w-]+", line)[0] for line in PROJECT["dependencies"]):
        assert re.search(rf"\b{name}\b", notice), name
        about = metadata(name)
        licenses = [about.get("License-Expression") or "", *(about.get_all("Classifier") or [])]
        if "LGPL" in " ".join(licenses):
            assert re.search(
                rf"^{name}\n +GNU Lesser General Public License", notice, re.MULTILINE
            ), name


def test_the_lock_is_up_to_date():
    lock = tomllib.loads((ROOT / "uv.lock").read_text(encoding="utf-8"))
    own = next(package for package in lock["package"] if package["name"] == PROJECT["name"])[
        "metadata"
    ]
    locked = {
        (entry["name"], entry.get("specifier", ""), entry.get("marker", ""))
        for entry in own["requires-dist"]
    }
    groups = {"": PROJECT["dependencies"]} | {
        f"extra == '{extra}'": lines for extra, lines in EXTRAS.items()
    }
    assert locked == {
        (*split(line), marker) for marker, lines in groups.items() for line in lines
    }, "run uv lock"
    files = [
        file
        for package in lock["package"]
        for file in (package.get("sdist"), *package.get("wheels", ()))
        if file
    ]
    assert {urlsplit(file["url"]).netloc for file in files} == {"files.pythonhosted.org"}
    assert all(file["hash"].startswith("sha256:") for file in files)
