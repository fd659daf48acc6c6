"""Packages that need not be there."""

import json
import re
import sys
import tomllib
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import maniport as mp
from maniport import optional
from maniport.errors import MissingPackageError
from maniport.optional import optional_package

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "maniport"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CALLED = {"pyyaml": "yaml", "scikit-learn": "sklearn", "pin": "pinocchio", "pin-pink": "pink", "pot": "ot"}
CALLED |= {"rerun-sdk": "rerun"}
"""What is imported under another name than it is installed by."""
BROUGHT = {"coal", "contourpy", "PIL", "llvmlite", "msgspec", "websockets"}
"""What comes with Pinocchio, matplotlib, Numba and, the last two, viser, whose door was passed before."""
WITHOUT = {"fast_simplification", "IPython"}
"""What is done without where it is not there: meshes are coarser, there is no notebook to draw in."""
DOORS = {name: door.args for name, door in vars(optional).items() if isinstance(door, partial)}


def imported(requirements):
    """Names under which what is asked for is imported."""
    names = [re.match(r"[\w-]+", one)[0].lower() for one in requirements]
    return {CALLED.get(name, name.replace("-", "_")) for name in names}


def test_a_package_that_is_there_is_imported():
    """What is installed comes as it is."""
    assert optional_package("json", "none", "this") is json


def test_a_missing_package_is_named_with_who_needs_it_and_what_installs_it():
    """The error says what is needed, for what, and how to install it."""
    with pytest.raises(MissingPackageError, match=r'the talk needs no_such_package.*pip install "maniport\[talk\]"'):
        optional_package("no_such_package", "talk", "the talk")


def test_optimal_transport_is_asked_for_where_it_is_chosen(monkeypatch):
    """Only the correspondence of that name needs POT, and says how to install it."""
    monkeypatch.setitem(sys.modules, "ot", None)
    domain = np.eye(3) * np.arange(1.0, 9.0)[:, None, None] + np.diag([0.0, 1.0, 2.0])
    mp.RiemannianICP(random_state=0).fit(domain, 2.0 * domain)
    with pytest.raises(
        MissingPackageError, match=r'the correspondence .* needs ot.*pip install "maniport\[transport\]"'
    ):
        mp.RiemannianICP(correspondence="transport", random_state=0).fit(domain, 2.0 * domain)


@pytest.mark.parametrize("door", DOORS)
def test_the_extra_that_is_named_installs_what_is_missing(door):
    """Each optional package is asked for by the extra that its message names."""
    package, extra, _ = DOORS[door]
    assert package.partition(".")[0] in imported(PROJECT["optional-dependencies"][extra])


@pytest.mark.parametrize("door", DOORS)
def test_what_is_not_there_is_told_with_the_command_that_installs_it(door, monkeypatch):
    """Without the package each door says who needs it, and how it is installed."""
    package, extra, what = DOORS[door]
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingPackageError, match=re.escape(what)) as caught:
        getattr(optional, door)()
    assert str(caught.value).endswith(f': pip install "maniport[{extra}]"')


def test_what_may_be_missing_is_imported_by_its_door_only():
    """Every import is of Python, of what the package depends on, or one that is written down as an exception."""
    lines = re.compile(r"^ *(?:from|import) ([A-Za-z]\w*)", re.MULTILINE)
    found = {name for file in PACKAGE.rglob("*.py") for name in lines.findall(code(file))}
    assert found <= {*sys.stdlib_module_names, "maniport", *imported(PROJECT["dependencies"]), *BROUGHT, *WITHOUT}


def code(file):
    """A module without its texts, which may have lines that begin as an import does."""
    return re.sub(r'"""(?s:.*?)"""', "", file.read_text(encoding="utf-8"))
