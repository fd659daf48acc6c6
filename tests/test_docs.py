"""Pages and docstrings name what exists: modules and their contents, commands, files, figures."""

import ast
import importlib
import inspect
import json
import re
import runpy
import tomllib
import types
import typing
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import typer

from maniport.cli import app
from maniport.pipeline.extensions import GROUPS

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "src" / "maniport"
PAGES = sorted(
    [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").glob("*.md")]
)
HAND_WRITTEN = [page for page in PAGES if page.name not in ("CHANGELOG.md", "BENCHMARKS.md")]
KNOWN_HOSTS = {
    *("arxiv.org", "github.com", "keepachangelog.com", "maniport.github.io"),
    *("mutmut.readthedocs.io", "semver.org"),
}
SITE = runpy.run_path(str(ROOT / "docs" / "_ext" / "public_names.py"))
HOMES = sorted({home for homes in SITE["every_home"]().values() for home in homes.values()})
hand_written = pytest.mark.parametrize(
    "page", HAND_WRITTEN, ids=lambda page: str(page.relative_to(ROOT))
)
every_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))


def resolved(name):
    """Return the object of a dotted name; raises AttributeError or ModuleNotFoundError. Functions precede modules."""
    thing = importlib.import_module("maniport")
    for number, part in enumerate(name.split(".")[1:], 2):
        path = ".".join(name.split(".")[:number])
        thing = getattr(thing, part) if hasattr(thing, part) else importlib.import_module(path)
    return thing


def missing(names):
    wrong = []
    for name in sorted(names):
        try:
            resolved(name)
        except (AttributeError, ModuleNotFoundError):
            wrong.append(name)
    return wrong


def dotted(text):
    return set(re.findall(r"\bmaniport(?:\.[A-Za-z_]\w*)+", text)) - set(GROUPS)


@hand_written
def test_what_a_page_names_exists(page):
    text = page.read_text(encoding="utf-8")
    short = {
        f"maniport.{name}" for name in re.findall(r"\bmp\.([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)", text)
    }
    assert missing(dotted(text) | short) == []
    paths = re.findall(r"`((?:src|tests|docs|examples|scripts|benchmarks)/[\w./-]*)`", text)
    assert [path for path in paths if not (ROOT / path).exists()] == []
    for block in re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL):
        ast.parse(block)
    commands = typer.main.get_command(app).commands
    for command, rest in re.findall(r"(?:`|bin/)maniport ([a-z]+)([^`\n]*)", text):
        options = {name for parameter in commands[command].params for name in parameter.opts}
        assert set(re.findall(r"(?<= )--?[a-z-]+", rest)) <= options | {"--help"}


def test_modules_have_no_other_names():
    assert not any(
        hasattr(importlib.import_module(module), "no_such_name") for module in SITE["MODULES"]
    )


def test_what_docstrings_name_exists():
    assert (
        missing(
            set().union(
                *(dotted(file.read_text(encoding="utf-8")) for file in PACKAGE.rglob("*.py"))
            )
        )
        == []
    )


@every_page
def test_links_of_a_page_lead_somewhere(page):
    """Relative links lead to files, included parts exist, other addresses are of known hosts (`make links`)."""
    text = page.read_text(encoding="utf-8")
    local = [
        target
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text)
        if not re.match(r"[a-z]+:", target)
    ]
    assert [target for target in local if not (page.parent / target).exists()] == []
    for block in re.findall(r"```\{include\} (\S+\n.*?)```", text, flags=re.DOTALL):
        other, marks = block.split("\n", 1)
        included = (page.parent / other).read_text(encoding="utf-8")
        for mark in re.findall(r':(?:start-after|end-before): "(.+)"', marks):
            _, found, included = included.partition(mark)
            assert found, f"{other} has no {mark}"
    addresses = re.findall(r"\bhttps?://[^\s)>\"`]+", text)
    parts = [
        urlsplit(address)
        for address in addresses
        if not re.match(r"http://(localhost|127\.)", address)
    ]
    assert [
        part.geturl()
        for part in parts
        if part.scheme != "https" or part.hostname not in KNOWN_HOSTS
    ] == []


def test_the_page_of_the_architecture_has_every_module_and_contract():
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    folders = {file.parent.name for file in PACKAGE.rglob("__init__.py")} - {PACKAGE.name}
    assert [folder for folder in sorted(folders) if f" {folder}/" not in page] == []
    assert [file.name for file in PACKAGE.glob("[a-z]*.py") if f" {file.name}" not in page] == []
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = project["tool"]["importlinter"]["contracts"]
    layers = next(contract["layers"] for contract in contracts if contract["type"] == "layers")
    assert "\n".join(["```", *layers, "```"]).replace("maniport.", "") in page


def test_figures_of_the_readme_are_those_that_were_measured():
    """Those of the demo are in docs/demo.json (`make_readme_pictures.py --check`)."""
    demo = json.loads((ROOT / "docs" / "demo.json").read_text(encoding="utf-8"))
    distance = [f"{demo[f'distance_{name}']:.2f}" for name in ("median", "95", "largest")]
    error = [f"{demo[f'position_error_{name}_mm']:.1f}" for name in ("median", "95", "largest")]
    duration = f"{demo['duration_s']:.1f} s"
    person = f"{demo['person_s']:.1f} s"
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    rival = f"(positions only {demo['force_N_positions_only']:.0f} N)"
    force = f"{demo['force_N']:.0f} N where the person is strong {rival}"
    slower = f"({demo['speed_m/s_positions_only']:.1f} m/s)"
    speed = f"{demo['speed_m/s']:.1f} m/s where the person is fast {slower}"
    assert f"{force}, {speed}" in readme
    assert f"(docs/distances.md) {' / '.join(distance)} (median" in readme
    assert f"position error {' / '.join(error)} mm, {duration} (person {person})" in readme
    page = " ".join((ROOT / "docs" / "quality.md").read_text(encoding="utf-8").split())
    assert f"distance of {' / '.join(distance)} from their targets" in page
    assert f"position error is {' / '.join(error)} mm, and the motion takes {duration}" in page


@pytest.mark.parametrize("home", [home for home in HOMES if callable(resolved(home))])
def test_docstrings_of_public_names_are_complete(home):
    thing = resolved(home)
    text = inspect.getdoc(thing)
    assert re.match(r"\w.{10,}[.:]$", " ".join(text.split("\n\n")[0].split()))
    sections = set(re.findall(r"^(\w[\w ]*)\n-{3,}\n", text, flags=re.MULTILINE))
    is_class = inspect.isclass(thing)
    if (
        not (is_class and thing.__init__ is object.__init__)
        and len(inspect.signature(thing).parameters) > 2
    ):
        assert sections & {"Parameters", "Attributes"}
    if not is_class:
        back = typing.get_type_hints(inspect.unwrap(thing)).get("return")
        own = isinstance(back, type) and back.__module__.startswith("maniport.")
        assert back is types.NoneType or own or sections & {"Returns", "Yields"}
