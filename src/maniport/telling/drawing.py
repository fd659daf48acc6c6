"""Figures of results."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from maniport.atomic_io import written_whole
from maniport.pipeline import BothResult, TransferResult
from maniport.pipeline.both_result import FOLDERS
from maniport.pipeline.execution import Execution
from maniport.telling.renderings import ENDINGS
from maniport.telling.roles import ACHIEVED, PERSON, TARGET
from maniport.validation import Array

if TYPE_CHECKING:  # slow to load
    from maniport.telling.page.motions import Charted

SAME = 1e-9
"""Corners of two arms no farther apart are one [m]."""
STILL_COLORS = 256
"""So many keep pale blue apart from pale green."""


@dataclass(frozen=True)
class Drawn:
    """A figure: its name, what its files hold by their endings, and a small picture of it as a PNG."""

    name: str
    files: Mapping[str, bytes]
    small: bytes

    def write(self, folder: Path) -> None:
        """Write the files to a folder, each whole or not at all."""
        for ending, content in self.files.items():
            with written_whole(folder / f"{self.name}{ending}") as temporary:
                temporary.write_bytes(content)


Drawing = Callable[[], Drawn]
"""Draws a figure."""


@dataclass(frozen=True)
class OfProfiles:
    """What draws a run without its robot's motion: figures of its profiles, and all on one map with its figure."""

    profiles: tuple[Drawing, ...]
    charted: "Callable[[], tuple[Charted, Drawn]]"


def of_profiles(result: TransferResult) -> OfProfiles:
    """Return what draws the profiles of a run."""
    from maniport.telling.page.motions import seen  # slow to load

    profiles, roles = _profiles(result, result.demonstrated_profile, result.target_profile)
    unit, figures = result.spec.unit, list[Drawing]()
    if result.spec.part != "full":
        figures.append(drawing("ellipsoids", result.time, profiles, unit=unit, roles=roles))
        figures.append(drawing("curves", result.time, profiles, unit, roles))
    domains, lines = seen(result)
    named, roles = _profiles(result, lines[PERSON.name], lines[TARGET.name])
    roles |= {result.robot.name: ACHIEVED.name}
    bodies = {PERSON.name: "person", ACHIEVED.name: result.robot.name}
    return OfProfiles(tuple(figures), partial(_on_map, domains, lines, bodies, named, roles, result.time))


def of_arms(result: TransferResult, execution: Execution) -> Drawing:
    """Return what draws person and robot with their ellipsoids."""
    names = "person", result.robot.name
    skeletons, ellipsoids = (dict(zip(names, of, strict=True)) for of in _postures(result, execution))
    return _in_space(result, skeletons, ellipsoids)


def of_both_arms(result: BothResult) -> Drawing:
    """Return what draws both arms of the person and both of the robot with their ellipsoids."""
    skeletons: dict[str, Array] = {}
    ellipsoids: dict[str, Array] = {}
    within: dict[str, str] = {}
    for side, one, base in zip(FOLDERS, result.each, result.fits.bases, strict=True):
        assert one.execution is not None
        lines, shells = _postures(one, one.execution)
        for home, line, shell in zip(("person", result.robot.name), lines, shells, strict=True):
            name = f"{home}, {side}"
            skeletons[name], ellipsoids[name], within[name] = line, shell, home
        middle = np.zeros((len(lines[0]), 1, 3))  # of the one trunk, from which both arms go
        skeletons[f"person, {side}"] = np.concatenate([middle, lines[0] + base], axis=1)
    left, right = (f"{result.robot.name}, {side}" for side in FOLDERS)
    skeletons[right] = _branching(skeletons[left], skeletons[right])
    return _in_space(result.left, skeletons, ellipsoids, within)


def _branching(line: Array, other: Array) -> Array:
    """What of a skeleton (n, k, 3) goes its own way beside another."""
    count = min(line.shape[1], other.shape[1])
    apart = np.any(np.abs(line[:, :count] - other[:, :count]) > SAME, axis=(0, 2))
    first = int(apart.argmax()) if apart.any() else 0
    return other[:, max(first - 1, 0) :]


def _postures(result: TransferResult, execution: Execution) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Skeletons of person and robot, and their ellipsoids."""
    # the robot follows velocity ellipsoids, whatever kind was transferred: both are drawn in their unit
    force = result.spec.kind == "force"
    person = np.asarray(np.linalg.inv(result.demonstrated_profile)) if force else result.demonstrated_profile
    skeletons = (
        result.fit.arm.skeleton(result.fit.joint_angles),
        result.robot.skeleton(execution.motion.joint_positions),
    )
    return skeletons, (person, execution.motion.achieved)


def _in_space(
    result: TransferResult,
    skeletons: dict[str, Array],
    ellipsoids: dict[str, Array],
    within: dict[str, str] | None = None,
) -> Drawing:
    """Return what draws what is a person's, by its name, and what is a robot's."""
    roles = {name: (PERSON if name.startswith("person") else ACHIEVED).name for name in skeletons}
    note = "velocity ellipsoids: the inverses of the force ellipsoids" if result.spec.kind == "force" else ""
    return drawing("arms", skeletons, ellipsoids, unit=result.spec.velocity.unit, note=note, roles=roles, within=within)


def of_motion(execution: Execution) -> Drawing:
    """Return what draws how well the robot follows over time, and its joints within their limits."""
    return drawing("motion", execution.motion.time, *_over_time(execution, execution.motion.joint_names))


def of_both_motions(result: BothResult) -> Drawing:
    """Return what draws the same of both arms, side by side; joints that both share stand with the left one's."""
    robot, arms, time = result.robot, dict[str, tuple[Any, ...]](), np.zeros(0)
    for side, one, columns in zip(FOLDERS, result.each, robot.columns, strict=True):
        assert one.execution is not None
        time = one.execution.motion.time
        arms[side.capitalize()] = _over_time(one.execution, tuple(robot.joint_names[k] for k in columns))
    return drawing("motions", time, arms)


def _over_time(execution: Execution, names: tuple[str, ...]) -> tuple[Any, ...]:
    """What `maniport.telling.figures.motion` draws after the time; names are those of the joints."""
    found, robot = execution.motion, execution.robot
    limits = zip(robot.lower.tolist(), robot.upper.tolist(), strict=True)
    return (
        found.distance,
        dict(zip(names, found.joint_positions.T, strict=True)),
        dict(zip(names, limits, strict=True)),
        found.position_error,
        dict(zip(names, found.joint_units, strict=True)),
    )


def drawing(name: str, *content: Any, **options: Any) -> Drawing:
    """Return what draws a figure of `maniport.telling.figures`."""
    return partial(_drawn, name, *content, **options)


def _drawn(name: str, *content: Any, **options: Any) -> Drawn:
    from maniport.telling import figures  # slow to load

    figure = getattr(figures, name)(*content, **options)
    files = {ending: figures.encoded(figure, ending) for ending in ENDINGS}
    return Drawn(name, files, _small(files[".png"]))


def _on_map(
    domains: dict[str, Array],
    profiles: dict[str, Array],
    bodies: dict[str, str],
    named: dict[str, Array],
    roles: dict[str, str],
    time: Array,
) -> "tuple[Charted, Drawn]":
    """Fit a map to domains and profiles by role, place the domains there, and draw it with the names of all."""
    from maniport.telling.page.motions import charted

    found = charted(domains, profiles)
    clouds, places = ({bodies[role]: one for role, one in of.items()} for of in (domains, found.places))
    return found, _drawn("diffusion_map", clouds, named, time=time, roles=roles, chart=found.chart, places=places)


def _profiles(result: TransferResult, person: Array, target: Array) -> tuple[dict[str, Array], dict[str, str]]:
    """Name the person's ellipsoids and the target, and tell whose they are."""
    goal = f"target for {result.robot.name}"
    return {"person": person, goal: target}, {"person": PERSON.name, goal: TARGET.name}


def _small(png: bytes) -> bytes:
    """Make a picture smaller, and of few colours."""
    from PIL import Image  # matplotlib needs it

    stream = BytesIO()
    with Image.open(BytesIO(png)) as image:
        small = image.convert("RGB").resize((image.width // 2, image.height // 2), Image.Resampling.LANCZOS)
    small.quantize(STILL_COLORS, dither=Image.Dither.NONE).save(stream, "png", optimize=True)
    return stream.getvalue()
