"""Pages with one section, and a parser that checks them."""

import json
from html.parser import HTMLParser

from maniport.report.page import as_html
from maniport.report.values import Metric, Report, Section, Table

VOID = {"meta", "link", "img", "br", "input", "hr"}


class Page(HTMLParser):
    """Elements of a page, the texts of its scripts and styles, and whether every element is closed."""

    def __init__(self, text):
        super().__init__()
        self.open = []
        self.elements = []
        self.scripts = []
        self.styles = []
        self.text = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)
        if self.open[-1:] == ["script"]:
            self.scripts.append((self.elements[-1][1], data))
        if self.open[-1:] == ["style"]:
            self.styles.append(data)


def page_of(*parts, animation=None, warnings=("a warning",), title="a title"):
    """The page of metrics, tables and an animation, as text."""
    metrics, tables = (
        [part for part in parts if isinstance(part, kind)] for kind in (Metric, Table)
    )
    section = Section("a section", tuple(metrics), tuple(tables), text="one\ntwo")
    section.warn("some", *warnings)
    return as_html(Report(title, "a lead", (section,)), animation)


def motion_of(text):
    """Return the data of the animation of a page, with arrays as they are encoded."""
    scripts = Page(text).scripts
    return json.loads(next(data for names, data in scripts if names.get("id") == "motion"))
