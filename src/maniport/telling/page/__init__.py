"""A page that can be sent: what was done, what came out, and the motion itself, to look at without a network.

It takes values and arrays (`maniport.telling.page.content`) and gives one HTML file. The scripts and the style sheet
in ``assets`` are part of the file; they draw with WebGL and SVG and load nothing.
"""

from maniport.telling.page.body import Body, Part
from maniport.telling.page.content import (
    Cloud,
    DomainMap,
    Fact,
    Line,
    Motion,
    Panel,
    Picture,
    Report,
    Section,
    Table,
)
from maniport.telling.page.page import as_html, write_report
from maniport.telling.page.profiles import domain_map, ellipsoid_panels

__all__ = [
    "Body",
    "Cloud",
    "DomainMap",
    "Fact",
    "Line",
    "Motion",
    "Panel",
    "Part",
    "Picture",
    "Report",
    "Section",
    "Table",
    "as_html",
    "domain_map",
    "ellipsoid_panels",
    "write_report",
]
