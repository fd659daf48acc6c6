"""Pages of the public names: what a room lists in ``__all__`` has a page, and nothing else has."""

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

ROOMS = (
    "maniport", "maniport.spd", "maniport.arms", "maniport.mocap", "maniport.domain", "maniport.transfer",
    "maniport.learning", "maniport.motion", "maniport.evaluation", "maniport.pipeline", "maniport.live",
    "maniport.batch", "maniport.report",
)  # fmt: skip
"""In the order in which data flow."""


def write_pages(app: "Sphinx", config: "Config") -> None:
    """Write a page for each room and each of its names, before the sources are looked for."""
    folder = Path(app.srcdir) / "api"
    (folder / "names").mkdir(exist_ok=True)
    written = set()
    for room, homes in every_home().items():
        _write(folder / f"{room}.rst", _room_page(room, homes))
        for name, home in homes.items():
            if home == f"{room}.{name}":
                _write(folder / "names" / f"{home}.rst", _name_page(room, name))
                written.add(f"{home}.rst")
    for old in folder.glob("names/*.rst"):
        if old.name not in written:
            old.unlink()


@cache
def every_home() -> dict[str, dict[str, str]]:
    """The names of each room, each with the one place that its page is about: ``maniport.Arm`` is that of bodies."""
    at_home = {id(one): f"{room}.{name}" for room in ROOMS[1:] for name, one in public(room).items()}
    return {
        room: {name: at_home.get(id(one), f"{room}.{name}") for name, one in public(room).items()} for room in ROOMS
    }


def classes() -> dict[str, str]:
    """Classes and errors by their short names, each with its home."""
    errors = [name for name, one in vars(importlib.import_module("maniport.errors")).items() if inspect.isclass(one)]
    named = {name: home for names in every_home().values() for name, home in names.items() if name[0].isupper()}
    capitals = {name: home for name, home in named.items() if not name.isupper()}
    return capitals | {name: f"maniport.errors.{name}" for name in errors if name.endswith(("Error", "Warning"))}


def led_home(app: "Sphinx", env: "BuildEnvironment", node: "pending_xref", contents: "Element") -> "Element | None":
    """Link a name of another room, or of ``maniport`` itself, to its page; common words alone may be arguments."""
    homes = {name: home for names in every_home().values() for name, home in names.items() if name != "READERS"}
    homes |= classes()
    target = node.get("reftarget", "")
    name, _, member = target.removeprefix("maniport.").partition(".")
    common = name.islower() and "_" not in name and not target.startswith("maniport.")
    if node.get("refdomain") != "py" or common or name not in homes:
        return None
    full = f"{homes[name]}.{member}".rstrip(".")
    python = env.get_domain("py")
    return python.resolve_xref(env, node["refdoc"], app.builder, "obj", full, node, contents)  # type: ignore[arg-type]


def public(room: str) -> dict[str, Any]:
    """The public names of a room that are no rooms themselves."""
    module = importlib.import_module(room)
    listed = getattr(module, "__all__", None)
    if listed is None:
        listed = [name for name, one in vars(module).items() if getattr(one, "__module__", "") == room]
    found = {name: getattr(module, name) for name in sorted(listed) if not name.startswith("_")}
    return {name: one for name, one in found.items() if not isinstance(one, ModuleType)}


def _room_page(room: str, homes: dict[str, str]) -> str:
    """What a room is for, and its names with their pages."""
    said = inspect.getdoc(importlib.import_module(room)) or ""
    lines = [*_title(f"``{room}``"), said, "", ".. autosummary::", "   :nosignatures:", ""]
    lines += [f"   ~{home}" for home in homes.values()]
    own = [home for name, home in homes.items() if home == f"{room}.{name}"]
    if own:
        lines += ["", ".. toctree::", "   :hidden:", "", *(f"   names/{home}" for home in own)]
    return "\n".join(lines) + "\n"


def _name_page(room: str, name: str) -> str:
    """All that is said of a name."""
    one = getattr(importlib.import_module(room), name)
    kind = "autoclass" if inspect.isclass(one) else "autofunction" if callable(one) else "autodata"
    lines = [*_title(f"{room}.{name}"), f".. {kind}:: {room}.{name}"]
    if kind == "autoclass":
        lines.append("   :members:")
    return "\n".join(lines) + "\n"


def _title(text: str) -> list[str]:
    return [text, "=" * len(text), ""]


def _write(path: Path, text: str) -> None:
    """Only where it changes anything, so that the next build is quick."""
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def setup(app: "Sphinx") -> dict[str, bool]:
    """Write the pages at the start, and lead links home at the end."""
    app.connect("config-inited", write_pages)
    app.connect("missing-reference", led_home)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
