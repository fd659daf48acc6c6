"""What a report shows, as plain values and arrays."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from maniport.errors import InvalidInputError
from maniport.telling.page.body import ROLES, Body, require_length, require_shape
from maniport.validation import Array, as_choice, as_finite, as_number, as_positive_semidefinite, as_times


@dataclass(frozen=True)
class Fact:
    """One number or setting, and what it means in one sentence."""

    name: str
    value: str
    meaning: str = ""


@dataclass(frozen=True)
class Table:
    """Rows of text under column names."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise InvalidInputError(
                    f"every row of a table must have {len(self.columns)} cells, one for each column; found {len(row)}"
                )


@dataclass(frozen=True)
class Picture:
    """A PNG picture, and what it shows for those who cannot see it."""

    png: bytes
    description: str

    def __post_init__(self) -> None:
        if not self.png.startswith(b"\x89PNG\r\n\x1a\n"):
            raise InvalidInputError(f"png must hold a PNG file; found bytes that begin with {self.png[:8]!r}")


@dataclass(frozen=True, eq=False)
class Line:
    """Values over time; nan where there are none. `style` 0 to 2 is full, dashed, dotted."""

    name: str
    values: Array
    role: str = "student"
    style: int = 0

    def __post_init__(self) -> None:
        as_choice(self.role, "role", ROLES)
        if self.style not in (0, 1, 2):
            raise InvalidInputError(f"style must be 0, 1 or 2; found {self.style!r}")
        values = np.asarray(self.values)
        if values.ndim != 1 or values.dtype.kind != "f" or np.isinf(values).any():
            raise InvalidInputError(f"values of the line {self.name!r} must be floats, shape (n,), nan where missing")


@dataclass(frozen=True, eq=False)
class Panel:
    """Lines with one axis.

    Attributes
    ----------
    title, unit : str
    lines : tuple of Line
    meaning : str
        One sentence.
    logarithmic : bool
    limits : (float, float) or None
        Bounds that the values keep to; the panel shades what is beyond.
    span : (float, float) or None
        Ends of the axis; by default those of the values.
    """

    title: str
    unit: str
    lines: tuple[Line, ...]
    meaning: str = ""
    logarithmic: bool = False
    limits: tuple[float, float] | None = None
    span: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if not self.lines:
            raise InvalidInputError(f"the panel {self.title!r} must have at least one line")


@dataclass(frozen=True, eq=False)
class Cloud:
    """Ellipsoids in the plane of two diffusion coordinates.

    Attributes
    ----------
    name, role : str
    coordinates : ndarray, shape (n, 2)
    ellipsoids : ndarray, shape (n, d, d)
        Shown one at a time where d is 2 or 3.
    """

    name: str
    role: str
    coordinates: Array
    ellipsoids: Array

    def __post_init__(self) -> None:
        as_choice(self.role, "role", ROLES)
        points = as_positive_semidefinite(self.ellipsoids, f"ellipsoids of the cloud {self.name!r}")
        require_shape(as_finite(self.coordinates, "coordinates"), "coordinates", (len(points), 2))


@dataclass(frozen=True, eq=False)
class DomainMap:
    """Domains as clouds, and profiles as lines whose points belong to the times of a motion."""

    domains: tuple[Cloud, ...]
    profiles: tuple[Cloud, ...] = ()
    note: str = ""


@dataclass(frozen=True, eq=False)
class Motion:
    """Something that moves and is played: arms, curves and a map under one clock.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Ascending [s].
    bodies : tuple of Body
        Side by side, of one scale.
    panels : mapping of str to tuple of Panel
        By what they are about.
    map : DomainMap or None
    unit : str
        Of semi-axes.
    size : float
        Length at which a semi-axis of one `unit` is drawn [m].
    clocks : mapping of str to float
        Other times to show, by name: this factor times the time since the start.
    legend : mapping of str to str
        What the ellipsoid of each role is.
    note : str
        Stands below the picture.
    """

    time: Array
    bodies: tuple[Body, ...]
    panels: Mapping[str, tuple[Panel, ...]] = field(default_factory=dict)
    map: DomainMap | None = None
    unit: str = ""
    size: float = 0.25
    clocks: Mapping[str, float] = field(default_factory=dict)
    legend: Mapping[str, str] = field(default_factory=dict)
    note: str = ""

    def __post_init__(self) -> None:
        count = len(as_times(self.time))
        as_number(self.size, "size", above=0.0)
        for body in self.bodies:
            require_length(body.skeleton, f"the skeleton of {body.name!r}", count)
        for line in (line for panels in self.panels.values() for panel in panels for line in panel.lines):
            require_length(np.asarray(line.values), f"the line {line.name!r}", count)
        for profile in self.map.profiles if self.map else ():
            require_length(profile.coordinates, f"the profile {profile.name!r}", count)


@dataclass(frozen=True, eq=False)
class Section:
    """A heading, sentences (a paragraph a line), and what they introduce."""

    title: str
    text: str = ""
    parts: tuple[Motion | Table | Picture | tuple[Fact, ...], ...] = ()


@dataclass(frozen=True, eq=False)
class Report:
    """A page.

    Attributes
    ----------
    title : str
    lead : str
        One or two sentences below the title.
    warnings : tuple of str
        What a reader should know before all else.
    sections : tuple of Section
    """

    title: str
    lead: str
    warnings: tuple[str, ...]
    sections: tuple[Section, ...]
