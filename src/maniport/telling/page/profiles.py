"""Panels and maps of profiles: the numbers of ellipsoids over time, and where they lie among what bodies can make."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from maniport.spd.ellipsoid import line_angles
from maniport.subsample import evenly_spaced
from maniport.telling.course import Course, courses
from maniport.telling.diffusion import DOTS, DiffusionMap, map_of, outline
from maniport.telling.figures.style import check_profiles
from maniport.telling.page.content import Cloud, DomainMap, Line, Panel
from maniport.telling.roles import ACHIEVED, TARGET
from maniport.validation import Array, as_points


def ellipsoid_panels(profiles: Mapping[str, ArrayLike], names: Mapping[str, str], unit: str) -> tuple[Panel, ...]:
    """Make panels of the angles between the axes of target and achieved, where both are, and of each semi-axis."""
    checked = check_profiles(profiles)
    d = next(iter(checked.values())).shape[-1]
    order = ("Longest", "Middle", "Shortest") if d == 3 else ("Longest", "Shortest")
    found = courses(checked)
    lengths = tuple(
        Panel(
            f"{word} semi-axis",
            unit,
            tuple(
                Line(names[role], one.semi_axes[:, d - 1 - k], role, wide=role == TARGET.name and len(found) > 1)
                for role, one in found.items()
            ),
            "How fast the hand gets along each principal axis at unit joint speed." if k == 0 else "",
        )
        for k, word in enumerate(order)
    )
    return (*_angles(found), *lengths)


def _angles(found: Mapping[str, Course]) -> tuple[Panel, ...]:
    """Make a panel of how far the axes of the achieved ellipsoid are turned from those of the target."""
    if not {TARGET.name, ACHIEVED.name} <= set(found):
        return ()
    target, achieved = found[TARGET.name], found[ACHIEVED.name]
    turns = {
        "longest": np.degrees(line_angles(target.longest, achieved.longest)),
        "shortest": np.degrees(line_angles(target.shortest, achieved.shortest)),
    }
    lines = tuple(Line(f"{word} axis", turn, ACHIEVED.name, k) for k, (word, turn) in enumerate(turns.items()))
    meaning = "Between target and achieved: 0° along it, 90° across. A line breaks where two axes are of one length."
    return (Panel("Turn of the axes", "°", lines, meaning, span=(0.0, 90.0)),)


def domain_map(
    domains: Mapping[str, tuple[str, ArrayLike]],
    profiles: Mapping[str, tuple[str, ArrayLike]],
    note: str = "",
    chart: DiffusionMap | None = None,
    gap: Array | None = None,
    places: Mapping[str, Array] | None = None,
) -> DomainMap:
    """Place domains and profiles in two diffusion coordinates."""
    clouds, lines = (
        {role: as_points(points, f"{kind}[{role!r}]", minimum=1) for role, (_, points) in sets.items()}
        for kind, sets in (("domains", domains), ("profiles", profiles))
    )
    shared = map_of([*clouds.values(), *lines.values()]) if chart is None else chart
    dots = {role: points[evenly_spaced(len(points), DOTS)] for role, points in clouds.items()}
    placed = {role: shared.transform(points) for role, points in dots.items()} if places is None else places
    return DomainMap(
        tuple(
            Cloud(domains[role][0], role, placed[role], points, outline(placed[role]) if role == ACHIEVED.name else ())
            for role, points in dots.items()
        ),
        tuple(
            Cloud(profiles[role][0], role, shared.transform(points), points, gap=gap if role == TARGET.name else None)
            for role, points in lines.items()
        ),
        note,
    )
