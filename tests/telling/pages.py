"""A page with one section, for tests of how things are shown."""

import base64

import numpy as np

from maniport.telling.facts import Fact, Facts, Section, Table, warnings_of
from maniport.telling.page import as_html, write_page
from maniport.telling.page.encoding import FORMS


def told(*parts, warnings=("mind",), title="a title"):
    """Facts with one section of facts and tables, and what is to be looked at beside them."""
    facts = tuple(part for part in parts if isinstance(part, Fact))
    tables = tuple(part for part in parts if isinstance(part, Table))
    shown = [part for part in parts if not isinstance(part, Fact | Table)]
    section = Section("a section", (*warnings_of("some", warnings), *facts), tables, text="one\ntwo")
    return Facts(title, "a lead", (section,)), {"a section": shown}


def page_of(*parts, **options):
    """The page of parts, as text."""
    return as_html(*told(*parts, **options))


def written(path, *parts, **options):
    """Write the page of parts."""
    write_page(path, *told(*parts, **options))
    return path


def unpacked(entry):
    """Arrays as the page's scripts see them; undoes `packed` and `packed_indices`."""
    form = next(form for form in FORMS if form in entry)
    return np.frombuffer(base64.b64decode(entry[form]), dtype=FORMS[form]).reshape(entry["shape"])
