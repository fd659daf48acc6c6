"""Panels and maps of profiles: the numbers of ellipsoids over time, and where they lie among what bodies can make."""

from collections.abc import Mapping

from numpy.typing import ArrayLike

from maniport.telling.course import courses
from maniport.telling.diffusion import DiffusionMap, map_of
from maniport.telling.figures.style import check_profiles
from maniport.telling.page.content import Cloud, DomainMap, Line, Panel
from maniport.telling.page.encoding import MAX_DOTS
from maniport.thinning import evenly
from maniport.validation import as_points


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
    checked = check_profiles(profiles)
    d = next(iter(checked.values())).shape[-1]
    order = ("longest", "middle", "shortest") if d == 3 else ("longest", "shortest")
    semi: list[Line] = []
    longest: list[Line] = []
    shortest: list[Line] = []
    size: list[Line] = []
    ratio: list[Line] = []
    for role, one in courses(checked).items():
        name = names[role]
        semi += [Line(f"{name}, {word}", one.semi_axes[:, d - 1 - k], role, k) for k, word in enumerate(order)]
        for lines, vectors in ((longest, one.longest), (shortest, one.shortest)):
            lines += [Line(f"{name}, {letter}", vectors[:, k], role, k) for k, letter in enumerate("xyz"[:d])]
        size.append(Line(name, one.volume, role))
        ratio.append(Line(name, one.condition, role))
    arrow = "Components of a unit vector along it, in the body's own base frame; its sign carries no meaning."
    return (
        Panel("Semi-axes", unit, tuple(semi), "How fast the hand gets along each principal axis at unit joint speed."),
        Panel("Direction of the longest axis", "", tuple(longest), arrow, span=(-1.0, 1.0)),
        Panel("Direction of the shortest axis", "", tuple(shortest), arrow, span=(-1.0, 1.0)),
        Panel("Volume" if d == 3 else "Area", f"({unit}){'³' if d == 3 else '²'}", tuple(size),
              "How much the arm can do in all directions together.", logarithmic=True),
        Panel("Condition", "λmax / λmin", tuple(ratio),
              "1 for a ball; large where one direction is nearly lost.", logarithmic=True),
    )  # fmt: skip


def domain_map(
    domains: Mapping[str, tuple[str, ArrayLike]],
    profiles: Mapping[str, tuple[str, ArrayLike]],
    note: str = "",
    chart: DiffusionMap | None = None,
) -> DomainMap:
    """Place domains and profiles in two diffusion coordinates.

    Parameters
    ----------
    domains, profiles : mapping of str to (str, array_like of shape (n, d, d))
        By role: what it is called, and SPD matrices.
    note : str
        What else a reader should know of them.
    chart : DiffusionMap, optional
        Default: the one that `maniport.telling.diffusion.map_of` fits to all of them.
    """
    clouds, lines = (
        {role: as_points(points, f"{kind}[{role!r}]", minimum=1) for role, (_, points) in sets.items()}
        for kind, sets in (("domains", domains), ("profiles", profiles))
    )
    shared = map_of([*clouds.values(), *lines.values()]) if chart is None else chart
    dots = {role: points[evenly(len(points), MAX_DOTS)] for role, points in clouds.items()}
    return DomainMap(
        tuple(Cloud(domains[role][0], role, shared.transform(points), points) for role, points in dots.items()),
        tuple(Cloud(profiles[role][0], role, shared.transform(points), points) for role, points in lines.items()),
        note,
    )
