"""What the project says of itself in several files is the same: versions, dependencies, systems."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

from maniport.version import __version__

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CONDA = {"pin": "pinocchio", "pin-pink": "pink", "matplotlib": "matplotlib-base"}
"""What conda-forge calls otherwise."""


def read(name):
    """A YAML file of the project."""
    return yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))


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


def test_what_is_claimed_of_python_is_tested():
    """The versions of Python in the classifiers are those of the workflow."""
    claimed = {one.split(" :: ")[-1] for one in PROJECT["classifiers"] if re.search(r"Python :: 3\.\d", one)}
    matrix = read(".github/workflows/tests.yml")["jobs"]["versions"]["strategy"]["matrix"]
    assert claimed <= set(matrix["python"])
    assert claimed


def test_the_hook_checks_by_the_style_of_the_project():
    """Before a commit ruff is at least as new as the one that lint asks for."""
    least = next(one for one in PROJECT["optional-dependencies"]["lint"] if one.startswith("ruff")).partition(">=")[2]
    hook = read(".pre-commit-config.yaml")["repos"][0]["rev"].removeprefix("v")
    assert [int(part) for part in hook.split(".")] >= [int(part) for part in least.split(".")]
