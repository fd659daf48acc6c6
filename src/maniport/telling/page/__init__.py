"""A page that can be sent: what was done, what came out, and the motion itself, to look at without a network.

It takes facts, and values and arrays to look at (`maniport.telling.page.content`), and gives one HTML file. The
scripts and the style sheet in ``assets`` are part of the file; they draw with WebGL and SVG and load nothing.
"""

from maniport.telling.page.content import Body, Cloud, DomainMap, Line, Motion, Panel, Part, Picture
from maniport.telling.page.page import as_html, write_page
from maniport.telling.page.profiles import domain_map, ellipsoid_panels

__all__ = [
    "Body",
    "Cloud",
    "DomainMap",
    "Line",
    "Motion",
    "Panel",
    "Part",
    "Picture",
    "as_html",
    "domain_map",
    "ellipsoid_panels",
    "write_page",
]
