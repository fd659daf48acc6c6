"""One table says whose colour is which; report, figures, live view, examples and pictures of the docs take it."""

import ast
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex

from maniport.telling import figures
from maniport.telling.facts import Facts
from maniport.telling.page import as_html
from maniport.telling.roles import ROLES

HOME = Path(__file__).parents[2]
CODE = sorted(path for room in ("src", "examples", "scripts") for path in (HOME / room).rglob("*.py"))


def test_colors_of_roles_stand_once():
    """No other file of the package, the examples and the scripts writes a role's colour, as text or as numbers."""
    for role in ROLES.values():
        if role.name == "reference":  # black belongs to everybody
            continue
        found = [path.name for path in CODE if role.color.lower() in path.read_text(encoding="utf-8").lower()]
        assert found == ["roles.py"]
        numbers = str(role.rgb)
        assert not [path.name for path in CODE if numbers in path.read_text(encoding="utf-8")]


def test_the_page_has_the_colors_of_the_table():
    """Its style names each role, on light ground and on dark ground."""
    style = re.search("<style>(.*?)</style>", as_html(Facts("a", "b")), re.DOTALL)[1]
    for role in ROLES.values():
        assert re.findall(f"--{role.name}:(#\\w+);", style) == [role.color, role.dark]


@pytest.mark.parametrize("role", ["person", "target", "achieved"])
def test_figures_have_the_colors_of_the_table(role):
    """A profile of a role is drawn in the role's colour, whatever its name and place."""
    figure = figures.curves(np.arange(3.0), {"x": np.stack([np.diag([1.0, 2.0, 3.0])] * 3)}, roles={"x": role})
    assert {to_hex(line.get_color()) for line in figure.axes[0].lines} == {ROLES[role].color.lower()}


def test_the_live_view_takes_the_table():
    """The shells of the live view are named after roles, and nothing there has a colour of theirs."""
    text = (HOME / "src" / "maniport" / "view" / "scene.py").read_text(encoding="utf-8")
    for shell, role in (("person}/ellipsoid", "PERSON"), ("robot}/achieved", "ACHIEVED"), ("robot}/target", "TARGET")):
        assert f'"{{{shell}", {role}.rgb' in text


def test_every_arm_of_examples_and_docs_has_a_role():
    """Arms are never drawn in the order of a list: a robot's own ellipsoids are green in every picture."""
    for path in [*HOME.glob("examples/*.py"), *HOME.glob("scripts/*.py")]:
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(call, ast.Call) and getattr(call.func, "attr", "") == "arms":
                assert "roles" in {keyword.arg for keyword in call.keywords}, path.name
