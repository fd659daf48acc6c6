"""What is said of every public name: what it is, what it takes, what comes out, and where to go on."""

import importlib
import inspect
import re
import runpy
import types
import typing
from pathlib import Path

import maniport

DOCS = Path(__file__).parents[1] / "docs"
SITE = runpy.run_path(str(DOCS / "_ext" / "public_names.py"))
HOMES = sorted({home for homes in SITE["every_home"]().values() for home in homes.values()})
SPOKEN_OF = [home for home in HOMES if callable(SITE["public"](home.rpartition(".")[0])[home.rpartition(".")[2]])]


def found(name):
    """What a dotted name stands for; a function goes before the file of its name."""
    thing = maniport
    for number, part in enumerate(name.split(".")[1:], 2):
        path = ".".join(name.split(".")[:number])
        thing = getattr(thing, part) if hasattr(thing, part) else importlib.import_module(path)
    return thing


def sections(home):
    """Sections of a name's docstring by their headings; what comes before them is that of the empty one."""
    parts = re.split(r"^(\w[\w ]*)\n-{3,}\n", inspect.getdoc(found(home)), flags=re.MULTILINE)
    return dict(zip(["", *parts[1::2]], [part.strip("\n") for part in parts[::2]], strict=True))


def takes(thing):
    """Whether a class or function is called with anything."""
    without = inspect.isclass(thing) and thing.__init__ is object.__init__
    return not without and bool(inspect.signature(thing).parameters)


def tells_of_itself(thing):
    """Whether what a function returns is nothing, or an object of maniport, which has a page that tells."""
    back = typing.get_type_hints(inspect.unwrap(thing)).get("return")
    return back is types.NoneType or (isinstance(back, type) and back.__module__.startswith("maniport."))


def test_every_name_has_a_summary():
    """What is said first of a public class or function is a sentence."""
    first = {home: " ".join(sections(home)[""].split("\n\n")[0].split()) for home in SPOKEN_OF}
    assert [home for home, said in first.items() if not re.match(r"\w.{10,}[.:]$", said)] == []


def test_every_name_says_what_it_takes():
    """Whatever is called with something has a section of it."""
    called = [home for home in SPOKEN_OF if takes(found(home))]
    assert [home for home in called if not {"Parameters", "Attributes"} & set(sections(home))] == []


def test_every_function_says_what_it_returns():
    """A function has a section of what it returns, unless that has a page of its own."""
    functions = [home for home in SPOKEN_OF if not inspect.isclass(found(home)) and not tells_of_itself(found(home))]
    assert [home for home in functions if not {"Returns", "Yields"} & set(sections(home))] == []


def test_what_names_lead_to_is_public():
    """Names under "See Also" are those of the same room, or whole ones, and have a page or a place on one."""
    wrong = []
    for home in SPOKEN_OF:
        for line in sections(home).get("See Also", "").splitlines():
            for name in (name.strip() for name in line.partition(" : ")[0].split(",")):
                full = name if name.startswith("maniport.") else f"{home.rpartition('.')[0]}.{name}"
                held = any(full == one or full.startswith(f"{one}.") for one in HOMES)
                wrong += [] if held and full != home and found(full) is not None else [(home, name)]
    assert wrong == []


def test_every_room_is_in_the_contents():
    """The page of the public names leads to those rooms that have one."""
    text = (DOCS / "api" / "index.md").read_text(encoding="utf-8")
    assert re.findall(r"^maniport[\w.]*$", text, flags=re.MULTILINE) == list(SITE["ROOMS"])
