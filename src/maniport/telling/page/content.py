"""What a page shows, as plain values and arrays."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from maniport.errors import InvalidInputError
from maniport.telling.course import as_skeletons
from maniport.telling.page.states import STATES
from maniport.telling.roles import ROLES
from maniport.validation import (
    Array,
    as_choice,
    as_finite,
    as_number,
    as_positive_semidefinite,
    as_times,
    require_shape,
)

RIGID = 1e-6
"""How far a pose may be from a rotation and a last row of 0 0 0 1."""


@dataclass(frozen=True, eq=False)
class Part:
    """The surface of a link.

    Attributes
    ----------
    points : ndarray, shape (m, 3)
        In its own frame [m].
    triangles : ndarray of int, shape (k, 3)
        Rows of `points`; which side is the outer one does not matter.
    poses : ndarray, shape (n, 4, 4)
        Of its frame in the base frame of the body [m], one for each time.
    """

    points: Array
    triangles: NDArray[np.integer]
    poses: Array

    def __post_init__(self) -> None:
        points = as_finite(self.points, "points")
        require_shape(points, "points", ("m", 3))
        corners = np.asarray(self.triangles)
        if corners.dtype.kind not in "iu" or corners.ndim != 2 or corners.shape[-1] != 3 or not len(corners):
            raise InvalidInputError(
                f"triangles must be whole numbers, shape (k, 3) with k ≥ 1; found {corners.dtype}, {corners.shape}"
            )
        if corners.min() < 0 or corners.max() >= len(points):
            raise InvalidInputError(
                f"triangles must name points from 0 to {len(points) - 1}; found {corners.min()} to {corners.max()}"
            )
        _require_rigid(as_finite(self.poses, "poses"))


@dataclass(frozen=True, eq=False)
class Body:
    """An arm that moves, with ellipsoids at its hand.

    Attributes
    ----------
    name : str
    skeleton : ndarray, shape (n, k, 3)
        Corners of its polyline from base to hand [m].
    ellipsoids : mapping of str to ndarray, shape (n, 3, 3)
        By role; semi-axes in the unit of the motion.
    path : ndarray, shape (n, 3), or None
        Target positions of its tip [m].
    parts : tuple of Part
        Surfaces that are drawn instead of the skeleton; readers can go back to it.
    turn : ndarray, shape (3, 3), or None
        Rotation from the frame of the other bodies to this one's, by which the camera turns, so that alike looks alike.
        None: they have one frame.
    figure : ndarray, shape (k, 7), or None
        What stands beside it, such as a trunk: rods from one point to another and their radii [m].
    beside : tuple of Body
        Others in its picture and its frame, such as the other arm.
    """

    name: str
    skeleton: Array
    ellipsoids: Mapping[str, Array] = field(default_factory=dict)
    path: Array | None = None
    parts: tuple[Part, ...] = ()
    turn: Array | None = None
    figure: Array | None = None
    beside: "tuple[Body, ...]" = ()

    @property
    def all(self) -> "tuple[Body, ...]":
        """All that is in its picture, itself first."""
        return self, *self.beside

    def __post_init__(self) -> None:
        corners = as_skeletons(self.skeleton, "skeleton")
        if self.turn is not None:
            pose = np.eye(4)
            pose[:3, :3] = as_finite(self.turn, "turn")
            _require_rigid(pose[None])
        if self.figure is not None:
            require_shape(as_finite(self.figure, "figure"), "figure", ("k", 7))
        for role, matrices in self.ellipsoids.items():
            as_choice(role, "role", tuple(ROLES))
            found = as_positive_semidefinite(matrices, f"ellipsoids[{role!r}]", 3)
            require_shape(found, f"ellipsoids[{role!r}]", (len(corners), 3, 3))
        if self.path is not None:
            require_shape(as_finite(self.path, "path"), "path", (len(corners), 3))
        for k, part in enumerate(self.parts):
            _require_length(part.poses, f"poses of parts[{k}] of {self.name!r}", len(corners))


@dataclass(frozen=True)
class Picture:
    """A PNG picture, and what it shows for those who cannot see it; a `still` stands for a motion without scripts."""

    png: bytes
    description: str
    still: bool = False

    def __post_init__(self) -> None:
        if not self.png.startswith(b"\x89PNG\r\n\x1a\n"):
            raise InvalidInputError(f"png must hold a PNG file; found bytes that begin with {self.png[:8]!r}")


@dataclass(frozen=True, eq=False)
class Line:
    """Values over time; nan where there are none.

    `style` 0 to 2 is full, dashed, dotted; a `wide` line is pale and lies below what may coincide with it.
    """

    name: str
    values: Array
    role: str = "achieved"
    style: int = 0
    wide: bool = False

    def __post_init__(self) -> None:
        as_choice(self.role, "role", tuple(ROLES))
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
    strip : bool
        Whether it is a strip until somebody opens it.
    """

    title: str
    unit: str
    lines: tuple[Line, ...]
    meaning: str = ""
    logarithmic: bool = False
    limits: tuple[float, float] | None = None
    span: tuple[float, float] | None = None
    strip: bool = False

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
    outline : tuple of ndarray, shape (m, 2)
        Closed lines around most of them.
    gap : ndarray, shape (n,), or None
        Their distances from what the robot can make, which colour a line.
    """

    name: str
    role: str
    coordinates: Array
    ellipsoids: Array
    outline: tuple[Array, ...] = ()
    gap: Array | None = None

    def __post_init__(self) -> None:
        as_choice(self.role, "role", tuple(ROLES))
        points = as_positive_semidefinite(self.ellipsoids, f"ellipsoids of the cloud {self.name!r}")
        require_shape(as_finite(self.coordinates, "coordinates"), "coordinates", (len(points), 2))
        for line in self.outline:
            require_shape(as_finite(line, "outline"), "outline", ("m", 2))
        if self.gap is not None:
            require_shape(as_finite(self.gap, "gap"), "gap", (len(points),))


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
    clocks : mapping of str to ndarray, shape (n,)
        Other times to show, by name [s].
    legend : mapping of str to str
        What the ellipsoid of each role is.
    note : str
        Stands below the picture.
    states : tuple of str
        How it goes at each time, a word of `maniport.telling.page.states.STATES`; none: nothing is known of it.
    opening : float or None
        The time that is shown first [s]; None: the start.
    """

    time: Array
    bodies: tuple[Body, ...]
    panels: Mapping[str, tuple[Panel, ...]] = field(default_factory=dict)
    map: DomainMap | None = None
    unit: str = ""
    size: float = 0.25
    clocks: Mapping[str, Array] = field(default_factory=dict)
    legend: Mapping[str, str] = field(default_factory=dict)
    note: str = ""
    states: tuple[str, ...] = ()
    opening: float | None = None

    def __post_init__(self) -> None:
        count = len(as_times(self.time))
        for state in dict.fromkeys(self.states):
            as_choice(state, "state", tuple(STATES))
        if self.states and len(self.states) != count:
            raise InvalidInputError(f"states must have {count} entries, one for each time; found {len(self.states)}")
        as_number(self.size, "size", above=0.0)
        for body in (one for shown in self.bodies for one in shown.all):
            _require_length(body.skeleton, f"the skeleton of {body.name!r}", count)
        for line in (line for panels in self.panels.values() for panel in panels for line in panel.lines):
            _require_length(np.asarray(line.values), f"the line {line.name!r}", count)
        for profile in self.map.profiles if self.map else ():
            _require_length(profile.coordinates, f"the profile {profile.name!r}", count)


def _require_length(array: Array, name: str, count: int) -> None:
    """Refuse an array that has not one entry for each time."""
    if len(array) != count:
        raise InvalidInputError(f"{name} must have {count} entries, one for each time; found {len(array)}")


def _require_rigid(poses: Array) -> None:
    require_shape(poses, "poses", ("n", 4, 4))
    turns = poses[:, :3, :3]
    gap = np.abs(turns @ np.swapaxes(turns, 1, 2) - np.eye(3)).max(axis=(1, 2))
    gap = np.maximum(gap, np.abs(poses[:, 3] - [0.0, 0.0, 0.0, 1.0]).max(axis=1))
    bad = np.flatnonzero((gap > RIGID) | (np.linalg.det(turns) < 0))
    if len(bad):
        raise InvalidInputError(
            f"poses must be rotations and positions, [[R, p], [0, 1]] with R Rᵀ = I to {RIGID:g} and det R = 1; "
            f"found one that is not at index {bad[0]} ({len(bad)} such entries)"
        )
