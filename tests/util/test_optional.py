import re
import sys
import tomllib
from functools import partial
from pathlib import Path

import pytest

from maniport.errors import MissingPackageError
from maniport.util import optional

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "src" / "maniport"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
IMPORT_NAMES = {"pyyaml": "yaml", "scikit-learn": "sklearn", "pin": "pinocchio", "pin-pink": "pink"}
IMPORT_NAMES |= {"rerun-sdk": "rerun"}
DEPENDENCIES_OF_OTHERS = {
    "coal",
    "contourpy",
    "PIL",
    "llvmlite",
    "markupsafe",
    "msgspec",
    "websockets",
}
WITH_FALLBACK = {"IPython"}
CHECKED_BEFORE = {
    "matplotlib",
    "mpl_toolkits",
    "mujoco",
    "sklearn",
    "pink",
}  # figures, tasks; what scikit-learn and Pink call
IMPORTERS = {
    name: importer.args
    for name, importer in vars(optional).items()
    if isinstance(importer, partial)
}


def import_names(requirements):
    names = [re.match(r"[\w-]+", requirement)[0].lower() for requirement in requirements]
    return {IMPORT_NAMES.get(name, name.replace("-", "_")) for name in names}


@pytest.mark.parametrize("importer", IMPORTERS)
def test_a_missing_package_is_reported_with_the_command_that_installs_it(importer, monkeypatch):
    package, extra, user = IMPORTERS[importer]
    assert package.partition(".")[0] in import_names(PROJECT["optional-dependencies"][extra])
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingPackageError, match=re.escape(user)) as caught:
        getattr(optional, importer)()
    assert str(caught.value).endswith(f'; in the clone: pip install ".[{extra}]"')


def test_other_imports_are_of_dependencies():
    lines = re.compile(r"^ *(?:from|import) ([A-Za-z]\w*)", re.MULTILINE)
    imported = {name for file in PACKAGE.rglob("*.py") for name in lines.findall(_code(file))}
    own = {"maniport", *import_names(PROJECT["dependencies"])}
    assert imported <= {
        *sys.stdlib_module_names,
        *own,
        *DEPENDENCIES_OF_OTHERS,
        *WITH_FALLBACK,
        *CHECKED_BEFORE,
    }


def _code(file):
    """Return a module without strings, which may have lines that begin as an import does, and imports for types."""
    without_strings = re.sub(r'"""(?s:.*?)"""', "", file.read_text(encoding="utf-8"))
    return re.sub(r"^if TYPE_CHECKING:\n(?:    .*\n|\n)+", "", without_strings, flags=re.MULTILINE)
