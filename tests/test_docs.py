"""Pages and docstrings name what exists: modules and their contents, files; and Python on pages compiles."""

import ast
import importlib
import json
import re
import tomllib
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import typer

from maniport import load_arm

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "src" / "maniport"
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").glob("*.md")])
WRITTEN_BY_HAND = [page for page in PAGES if page.name not in ("CHANGELOG.md", "BENCHMARKS.md")]


@pytest.mark.parametrize("page", WRITTEN_BY_HAND, ids=lambda page: str(page.relative_to(ROOT)))
def test_dotted_names_on_a_page_exist(page):
    """Every maniport.x.y, and every mp.x, on a page can be imported."""
    text = page.read_text(encoding="utf-8")
    short = {f"maniport.{name}" for name in re.findall(r"\bmp\.([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)", text)}
    assert [name for name in sorted(_dotted(text) | short) if not _exists(name)] == []


def test_dotted_names_in_the_package_exist():
    """Every maniport.x.y that the package's own text mentions can be imported."""
    mentioned = set().union(*(_dotted(file.read_text(encoding="utf-8")) for file in PACKAGE.rglob("*.py")))
    assert [name for name in sorted(mentioned) if not _exists(name)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_of_a_page_lead_somewhere(page):
    """Relative links of a page lead to files of the project."""
    targets = re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text(encoding="utf-8"))
    local = [target for target in targets if not re.match(r"[a-z]+:", target)]
    assert [target for target in local if not (page.parent / target).exists()] == []


@pytest.mark.parametrize("page", WRITTEN_BY_HAND, ids=lambda page: str(page.relative_to(ROOT)))
def test_paths_on_a_page_exist(page):
    """Paths in code font that begin in one of the project's folders exist."""
    folders = "src|tests|docs|examples|scripts|benchmarks"
    paths = re.findall(rf"`((?:{folders})/[\w./-]*)`", page.read_text(encoding="utf-8"))
    assert [path for path in paths if not (ROOT / path).exists()] == []


@pytest.mark.parametrize("page", WRITTEN_BY_HAND, ids=lambda page: str(page.relative_to(ROOT)))
def test_python_on_a_page_compiles(page):
    """Every Python block of a page is valid Python."""
    for block in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL):
        ast.parse(block)


@pytest.mark.parametrize("page", WRITTEN_BY_HAND, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_on_a_page_exist(page):
    """Commands in code font, and options that are named with them, are those of the command line."""
    from maniport.cli import app

    verbs = typer.main.get_command(app).commands
    for verb, rest in re.findall(r"(?:`|bin/)maniport ([a-z]+)([^`\n]*)", page.read_text(encoding="utf-8")):
        assert verb in verbs
        known = {name for parameter in verbs[verb].params for name in parameter.opts}
        assert set(re.findall(r"(?<= )--?[a-z-]+", rest)) <= known | {"--help"}


def test_the_map_of_the_house_shows_every_room_and_the_floors_that_are_kept():
    """Every folder of the package stands on the page of the house, and its floors are those of the import contracts."""
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    rooms = {file.parent.relative_to(PACKAGE).name for file in PACKAGE.rglob("__init__.py")} - {""}
    assert [room for room in sorted(rooms) if f" {room}/" not in page] == []
    assert [file.name for file in PACKAGE.glob("[a-z]*.py") if f" {file.name}" not in page] == []
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    floors = next(contract["layers"] for contract in contracts if contract["type"] == "layers")
    assert "\n".join(["```", *floors, "```"]).replace("maniport.", "") in page


def _dotted(text):
    return set(re.findall(r"\bmaniport(?:\.[A-Za-z_]\w*)+", text))


def _exists(name):
    parts = name.split(".")
    for split in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:split]))
        except ModuleNotFoundError:
            continue
        for part in parts[split:]:
            if not hasattr(found, part):
                return False
            found = getattr(found, part)
        return True
    return False


def cells(page, row):
    """The cells of a table's row that begins so."""
    line = next(line for line in (ROOT / page).read_text(encoding="utf-8").splitlines() if line.startswith(f"| {row}"))
    return [cell.strip() for cell in line.strip("|").split(" | ")]


def test_readme_tells_the_figures_of_its_pictures():
    """What it says of the demo is what the pictures were made from; `make_readme_pictures.py --check` runs it again."""
    made = json.loads((ROOT / "docs" / "demo.json").read_text(encoding="utf-8"))
    d = " / ".join(f"{made[f'distance_{name}']:.2f}" for name in ("median", "95", "largest"))
    tip = " / ".join(f"{made[f'tip_{name}_mm']:.1f}" for name in ("median", "95", "largest"))
    took, person = f"{made['duration_s']:.1f} s", f"{made['person_s']:.1f} s"
    assert cells("README.md", "The demo: ellipsoids from")[1] == d
    assert cells("README.md", "The demo: the tip")[1] == f"{tip} mm"
    assert cells("README.md", "The demo: how long")[1:] == [took, f"the person took {person}"]
    page = " ".join((ROOT / "docs" / "quality.md").read_text(encoding="utf-8").split())
    assert f"distance of {d} from their targets" in page
    assert f"the tip {tip} mm beside its path, and the motion takes {took} where the person took {person}" in page


def test_readme_tells_the_gaps_of_the_evaluation():
    """The gaps in the README are the row of the ladder on the page of the evaluation, with its end effector."""
    _, method, raw, _, transport, icp, field = cells("docs/evaluation.md", "ladder |")
    assert method == "lengths-field"
    assert transport == icp
    row = cells("README.md", "Target ellipsoids of the ladder")
    assert row[1:] == [field, f"raw copy {raw}, parallel transport {transport}"]
    assert f"`{load_arm('panda').frame}`, the default" in (ROOT / "docs" / "evaluation.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_what_a_page_takes_of_another_is_there(page):
    """Marks between which a page includes another stand in that one, in this order, with something between them."""
    for block in re.findall(r"```\{include\} (\S+\n.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL):
        other, marks = block.split("\n", 1)
        text = (page.parent / other).read_text(encoding="utf-8")
        for mark in re.findall(r':(?:start-after|end-before): "(.+)"', marks):
            before, found, text = text.partition(mark)
            assert found, f"{other} has no {mark}"
        assert ":end-before:" not in marks or before.strip()


KNOWN_HOSTS = {
    "arxiv.org",
    "github.com",
    "keepachangelog.com",
    "maniport.github.io",
    "mutmut.readthedocs.io",
    "semver.org",
}
"""Whose pages are referred to; that their addresses still answer only `make links` tells."""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_addresses_of_others_are_whole_and_known(page):
    """Addresses on a page, but for those of its own machine, are of the web's safe kind and of a known host."""
    addresses = re.findall(r"\bhttps?://[^\s)>\"`]+", page.read_text(encoding="utf-8"))
    parts = [urlsplit(address) for address in addresses if not re.match(r"http://(localhost|127\.)", address)]
    assert [part.geturl() for part in parts if part.scheme != "https" or part.hostname not in KNOWN_HOSTS] == []


def test_every_example_has_a_picture_and_says_what_it_shows():
    """The pictures of the gallery are those of the examples, each with a sentence."""
    examples = {file.stem for file in (ROOT / "examples").glob("*.py")}
    captions = json.loads((ROOT / "docs" / "gallery" / "captions.json").read_text(encoding="utf-8"))
    assert set(captions) == {file.stem for file in (ROOT / "docs" / "gallery").glob("*.png")} == examples
    assert all(text.endswith(".") for text in captions.values())
