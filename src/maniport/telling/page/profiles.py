"""Panels and maps of profiles: the numbers of ellipsoids over time, and where they lie among what bodies can make."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.spd.ellipsoid import axis_over_time, lengths, volume
from maniport.telling.diffusion import MAX_POINTS, DiffusionMap
from maniport.telling.page.content import Cloud, DomainMap, Line, Panel
from maniport.telling.page.encoding import MAX_DOTS, evenly
from maniport.validation import SPD_TOLERANCE, Array, as_points, as_positive_semidefinite

FITTED = 300
"""How many points of each domain and profile the map is fitted to, at most."""


def ellipsoid_panels(profiles: Mapping[str, ArrayLike], names: Mapping[str, str], unit: str) -> tuple[Panel, ...]:
    """Make panels of semi-axes, directions of the longest and the shortest axis, volume and condition.

    Parameters
    ----------
    profiles : mapping of str to array_like, shape (n, d, d)
        By role; d = 2 or 3.
    names : mapping of str to str
        What the roles are called.
    unit : str
        Of semi-axes.
    """
    checked = {role: as_positive_semidefinite(points, f"profiles[{role!r}]") for role, points in profiles.items()}
    d = next(iter(checked.values())).shape[-1]
    if d > 3 or len({points.shape for points in checked.values()}) > 1:
        found = ", ".join(f"{role} {points.shape}" for role, points in checked.items())
        raise InvalidInputError(f"profiles must all have one shape (n, d, d) with d = 2 or 3; found {found}")
    order = ("longest", "middle", "shortest") if d == 3 else ("longest", "shortest")
    semi: list[Line] = []
    major: list[Line] = []
    minor: list[Line] = []
    size: list[Line] = []
    ratio: list[Line] = []
    like: tuple[Array | None, Array | None] = (None, None)
    for role, points in checked.items():
        name, axes = names[role], lengths(points)
        directions = axis_over_time(points, -1, like[0]), axis_over_time(points, 0, like[1])
        like = directions if like[0] is None else like
        semi += [Line(f"{name}, {word}", axes[:, d - 1 - k], role, k) for k, word in enumerate(order)]
        for lines, vectors in zip((major, minor), directions, strict=True):
            lines += [Line(f"{name}, {letter}", vectors[:, k], role, k) for k, letter in enumerate("xyz"[:d])]
        # of a flat ellipsoid both are rounding, and have no place on a logarithmic axis
        flat = axes[:, 0] ** 2 <= SPD_TOLERANCE * np.trace(points, axis1=1, axis2=2)
        with np.errstate(divide="ignore", invalid="ignore"):
            condition = (axes[:, -1] / axes[:, 0]) ** 2
        size.append(Line(name, np.where(flat, np.nan, volume(points)), role))
        ratio.append(Line(name, np.where(flat, np.nan, condition), role))
    arrow = "Components of a unit vector along it, in the body's own base frame; its sign carries no meaning."
    return (
        Panel("Semi-axes", unit, tuple(semi), "How fast the hand gets along each principal axis at unit joint speed."),
        Panel("Direction of the longest axis", "", tuple(major), arrow, span=(-1.0, 1.0)),
        Panel("Direction of the shortest axis", "", tuple(minor), arrow, span=(-1.0, 1.0)),
        Panel("Volume" if d == 3 else "Area", f"({unit}){'³' if d == 3 else '²'}", tuple(size),
              "How much the arm can do in all directions together.", logarithmic=True),
        Panel("Condition", "λmax / λmin", tuple(ratio),
              "1 for a ball; large where one direction is nearly lost.", logarithmic=True),
    )  # fmt: skip


def domain_map(
    domains: Mapping[str, tuple[str, ArrayLike]], profiles: Mapping[str, tuple[str, ArrayLike]], note: str = ""
) -> DomainMap:
    """Place domains and profiles in two diffusion coordinates.

    Parameters
    ----------
    domains, profiles : mapping of str to (str, array_like of shape (n, d, d))
        By role: what it is called, and SPD matrices.
    note : str
        What else a reader should know of them.
    """
    clouds = {role: _thinned(points, f"domains[{role!r}]", MAX_DOTS) for role, (_, points) in domains.items()}
    lines = {role: as_points(points, f"profiles[{role!r}]", minimum=1) for role, (_, points) in profiles.items()}
    sets = [*clouds.values(), *lines.values()]
    limit = min(FITTED, MAX_POINTS // len(sets))
    chart = DiffusionMap().fit(np.concatenate([points[evenly(len(points), limit)] for points in sets]))
    return DomainMap(
        tuple(Cloud(domains[role][0], role, chart.transform(points), points) for role, points in clouds.items()),
        tuple(Cloud(profiles[role][0], role, chart.transform(points), points) for role, points in lines.items()),
        note,
    )


def _thinned(points: ArrayLike, name: str, most: int) -> Array:
    checked = as_points(points, name)
    return np.asarray(checked[evenly(len(checked), most)])
