"""API pages of the public names: those in ``__all__`` of the public modules."""

import importlib
import inspect
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from docutils.nodes import Element
    from sphinx.addnodes import pending_xref
    from sphinx.application import Sphinx
    from sphinx.config import Config
    from sphinx.environment import BuildEnvironment

MODULES = (
    "maniport", "maniport.spd", "maniport.arms", "maniport.mocap", "maniport.domain", "maniport.transfer",
    "maniport.learning", "maniport.motion", "maniport.datasets", "maniport.datasets.lerobot", "maniport.evaluation",
    "maniport.pipeline", "maniport.live", "maniport.batch", "maniport.audit", "maniport.report",
)  # fmt: skip
"""In the order in which data flow."""


def write_pages(app: "Sphinx", config: "Config") -> None:
    """Write a page for each public module and each of its names, before Sphinx reads the sources."""
    folder = Path(app.srcdir) / "api"
    (folder / "names").mkdir(exist_ok=True)
    written = set()
    for module, homes in every_home().items():
        _write(folder / f"{module}.rst", _module_page(module, homes))
        for name, home in homes.items():
            if home == f"{module}.{name}":
                _write(folder / "names" / f"{home}.rst", _name_page(module, name))
                written.add(f"{home}.rst")
    for old in folder.glob("names/*.rst"):
        if old.name not in written:
            old.unlink()


@cache
def every_home() -> dict[str, dict[str, str]]:
    """Return the names of each module with the full name of their page: ``maniport.Arm`` is ``maniport.arms.Arm``."""
    at_home = {
        id(one): f"{module}.{name}"
        for module in MODULES[1:]
        for name, one in public(module).items()
    }
    return {
        module: {
            name: at_home.get(id(one), f"{module}.{name}") for name, one in public(module).items()
        }
        for module in MODULES
    }


def classes() -> dict[str, str]:
    """Return the full names of classes and errors by their short names."""
    errors = [
        name
        for name, one in vars(importlib.import_module("maniport.errors")).items()
        if inspect.isclass(one)
    ]
    named = {
        name: home
        for names in every_home().values()
        for name, home in names.items()
        if name[0].isupper()
    }
    capitals = {name: home for name, home in named.items() if not name.isupper()}
    return capitals | {
        name: f"maniport.errors.{name}" for name in errors if name.endswith(("Error", "Warning"))
    }


def resolve_name(
    app: "Sphinx", env: "BuildEnvironment", node: "pending_xref", contents: "Element"
) -> "Element | None":
    """Link a name of any module to its page; common words may be arguments and are not linked."""
    homes = {
        name: home
        for names in every_home().values()
        for name, home in names.items()
        if name != "READERS"
    }
    homes |= classes()
    target = node.get("reftarget", "")
    name, _, member = target.removeprefix("maniport.").partition(".")
    common = name.islower() and "_" not in name and not target.startswith("maniport.")
    if node.get("refdomain") == "py" and common and not member and not node.get("refexplicit"):
        from sphinx.errors import NoUri  # tests import this file without Sphinx

        raise NoUri  # an argument such as time, not Python's module of that name
    if node.get("refdomain") != "py" or common or name not in homes:
        return None
    full = f"{homes[name]}.{member}".rstrip(".")
    python = env.get_domain("py")
    return python.resolve_xref(env, node["refdoc"], app.builder, "obj", full, node, contents)  # type: ignore[arg-type]


def public(module: str) -> dict[str, Any]:
    """Return the public names of a module without its submodules."""
    imported = importlib.import_module(module)
    names = getattr(imported, "__all__", None)
    if names is None:
        names = [
            name
            for name, value in vars(imported).items()
            if getattr(value, "__module__", "") == module
        ]
    values = {name: getattr(imported, name) for name in sorted(names) if not name.startswith("_")}
    return {name: value for name, value in values.items() if not isinstance(value, ModuleType)}


def _module_page(module: str, homes: dict[str, str]) -> str:
    """Return the page of a module: its docstring, and its names with one-line summaries."""
    text = inspect.getdoc(importlib.import_module(module)) or ""
    lines = [*_title(f"``{module}``"), text, "", ".. autosummary::", "   :nosignatures:", ""]
    lines += [f"   ~{home}" for home in homes.values()]
    own = [home for name, home in homes.items() if home == f"{module}.{name}"]
    if own:
        lines += ["", ".. toctree::", "   :hidden:", "", *(f"   names/{home}" for home in own)]
    return "\n".join(lines) + "\n"


def _name_page(module: str, name: str) -> str:
    """Return the page of a name."""
    one = getattr(importlib.import_module(module), name)
    kind = "autoclass" if inspect.isclass(one) else "autofunction" if callable(one) else "autodata"
    lines = [*_title(f"{module}.{name}"), f".. {kind}:: {module}.{name}"]
    if kind == "autoclass":
        lines.append("   :members:")
    return "\n".join(lines) + "\n"


def _title(text: str) -> list[str]:
    return [text, "=" * len(text), ""]


def _write(path: Path, text: str) -> None:
    """Write a changed file only, so that the next build is quick."""
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def setup(app: "Sphinx") -> dict[str, bool]:
    """Connect the functions to Sphinx."""
    app.connect("config-inited", write_pages)
    app.connect("missing-reference", resolve_name)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
