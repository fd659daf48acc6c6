"""Pages and docstrings name what exists: modules and their contents, files; and Python on pages compiles."""

import ast
import importlib
import json
import re
import tomllib
from pathlib import Path

import pytest
import typer

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


def test_readme_tells_the_figures_of_its_pictures():
    """What it says of the demo is what the pictures were made from; `make_readme_pictures.py --check` runs it again."""
    made = json.loads((ROOT / "docs" / "demo.json").read_text(encoding="utf-8"))
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    d = " / ".join(f"{made[f'distance_{name}']:.2f}" for name in ("median", "95", "largest"))
    tip = " / ".join(f"{made[f'tip_{name}_mm']:.1f}" for name in ("median", "95", "largest"))
    assert f"at a distance of {d} from their targets" in text
    assert f"the tip {tip} mm beside its path" in text
    assert f"takes {made['duration_s']:.1f} s where the person took {made['person_s']:.1f} s" in text
