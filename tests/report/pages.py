"""A page with one section, for tests of how things are shown."""

from html.parser import HTMLParser

from maniport.report.page import Cloud, DomainMap, as_html, write_page
from maniport.report.values import Metric, Report, Section, Table, warnings_of
from maniport.spd.diffusion_map import map_of

VOID = {"meta", "link", "img", "br", "input", "hr"}


class Page(HTMLParser):
    """Elements of a page, the texts of its scripts, and whether every element is closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.elements, self.scripts, self.styles, self.text = [], [], [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        """Keep an element."""
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        """Require that it closes what was opened last."""
        assert self.open.pop() == tag

    def handle_data(self, data):
        """Keep texts, scripts and styles."""
        self.text.append(data)
        if self.open[-1:] == ["script"]:
            self.scripts.append((self.elements[-1][1], data))
        if self.open[-1:] == ["style"]:
            self.styles.append(data)


def told(*parts, warnings=("mind",), title="a title"):
    """A report with one section of metrics and tables, and what is shown in it."""
    metrics = tuple(part for part in parts if isinstance(part, Metric))
    tables = tuple(part for part in parts if isinstance(part, Table))
    shown = [part for part in parts if not isinstance(part, Metric | Table)]
    section = Section("a section", (*warnings_of("some", warnings), *metrics), tables, text="one\ntwo")
    return Report(title, "a lead", (section,)), {"a section": shown}


def page_of(*parts, **options):
    """The page of parts, as text."""
    return as_html(*told(*parts, **options))


def written(path, *parts, **options):
    """Write the page of parts."""
    write_page(path, *told(*parts, **options))
    return path


def map_with(domains, profiles):
    """A map of ellipsoids by role."""
    chart = map_of([*domains.values(), *profiles.values()])
    clouds, lines = (
        tuple(Cloud(role, role, chart.transform(points), points) for role, points in sets.items())
        for sets in (domains, profiles)
    )
    return DomainMap(clouds, lines)
