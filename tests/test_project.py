"""What the project says of itself in several files is the same: versions, dependencies, systems."""

import re
import tomllib
from importlib.metadata import metadata
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import yaml

from maniport.version import __version__

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
CONDA = {"pin": "pinocchio", "pin-pink": "pink"}
"""What conda-forge calls otherwise."""


def read(name):
    """A YAML file of the project."""
    return yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))


def split(requirement):
    """Name, as PyPI spells it, and versions of what is asked for."""
    name = re.match(r"[\w-]+", requirement)[0]
    return name.lower(), requirement[len(name) :]


@pytest.mark.parametrize(
    "told",
    [
        pytest.param(lambda: read("CITATION.cff")["version"], id="citation"),
        pytest.param(lambda: read("conda/recipe.yaml")["context"]["version"], id="conda"),
    ],
)
def test_the_version_is_one(told):
    """Files that must repeat the version have that of the package."""
    assert told() == __version__


def test_the_recipe_asks_for_what_the_package_asks_for():
    """The recipe for conda-forge has the dependencies of pyproject.toml, by their names there."""
    asked = {re.sub(r"^[\w-]+", lambda name: CONDA.get(name[0].lower(), name[0].lower()), one).replace(" ", "")
             for one in PROJECT["dependencies"]}  # fmt: skip
    told = {one.replace(" ", "") for one in read("conda/recipe.yaml")["requirements"]["run"]}
    assert {one for one in told if not one.startswith("python")} == asked


def test_workflows_run_nothing_that_others_can_change():
    """Actions are pinned by commit, with the version in a comment; shell lines contain no expressions."""
    for file in (ROOT / ".github" / "workflows").glob("*.yml"):
        used = re.findall(r"uses: (.*)", file.read_text(encoding="utf-8"))
        assert used
        assert [one for one in used if not re.fullmatch(r"[\w./-]+@[0-9a-f]{40}  # v\d+\.\d+\.\d+", one)] == []
        steps = [step for job in read(file.relative_to(ROOT))["jobs"].values() for step in job["steps"]]
        assert [step["run"] for step in steps if "${{" in step.get("run", "")] == []


def test_the_notice_has_the_license_of_each_dependency():
    """All dependencies are named; those under the LGPL, by their metadata, with that license."""
    notice = (ROOT / "NOTICE").read_text(encoding="utf-8").partition("Dependencies are not included")[2]
    for name in (re.match(r"[\w-]+", one)[0] for one in PROJECT["dependencies"]):
        assert re.search(rf"\b{name}\b", notice), name
        about = metadata(name)
        licenses = [about.get("License-Expression") or "", *(about.get_all("Classifier") or [])]
        if "LGPL" in " ".join(licenses):
            assert re.search(rf"^{name}\n +GNU Lesser General Public License", notice, re.MULTILINE), name


def test_the_lock_is_of_what_the_project_asks_for():
    """The developers' lock was made for these dependencies and extras; all files are from PyPI, with hashes."""
    lock = tomllib.loads((ROOT / "uv.lock").read_text(encoding="utf-8"))
    own = next(one for one in lock["package"] if one["name"] == PROJECT["name"])["metadata"]
    told = {(one["name"], one.get("specifier", ""), one.get("marker", "")) for one in own["requires-dist"]}
    groups = {"": PROJECT["dependencies"]} | {f"extra == '{extra}'": each for extra, each in EXTRAS.items()}
    asked = {(*split(one), marker) for marker, each in groups.items() for one in each}
    assert told == asked, "uv lock brings it up to date"
    files = [file for one in lock["package"] for file in (one.get("sdist"), *one.get("wheels", ())) if file]
    assert {urlsplit(file["url"]).netloc for file in files} == {"files.pythonhosted.org"}
    assert all(file["hash"].startswith("sha256:") for file in files)
