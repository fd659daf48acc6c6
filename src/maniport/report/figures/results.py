"""Figures of a saved result: functions of the data of its page, listed in `maniport.report.renderings.FIGURES`."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from maniport.report.figures import drawing
from maniport.report.page.content import ACHIEVED, HUMAN_JOINTS, PERSON, Line, Panel
from maniport.util.validation import Array

ELLIPSOIDS = "Ellipsoids"  # topic of the curves of semi-axes
MATRIX = [0, 1, 2, 1, 3, 4, 2, 4, 5]  # entries of a symmetric matrix among xx, xy, xz, yy, yz, zz


def arms(data: dict[str, Any]) -> Figure | None:
    """Draw the arms with their ellipsoids."""
    skeletons, shells, roles, within = {}, {}, dict[str, str](), dict[str, str]()
    for stage, k, body, profiles in _bodies(data):
        name, role = f"{stage['name']}, arm {k + 1}", PERSON.name if PERSON.name in profiles else ACHIEVED.name
        skeletons[name], shells[name] = body["skeleton"], profiles[role]
        roles[name], within[name] = role, stage["name"]
    if not skeletons:
        return None
    return drawing.arms(skeletons, shells, size=data["size"], unit=data["unit"], roles=roles, within=within)


def ellipsoids(data: dict[str, Any]) -> Figure | None:
    """Draw ellipsoids of one arm over time, all in the frame of the person."""
    drawn = dict[str, Array]()
    for stage, _, _, profiles in _bodies(data):
        rotation = np.eye(3) if stage["rotation"] is None else np.reshape(stage["rotation"], (3, 3))
        drawn |= {name: rotation.T @ own @ rotation for name, own in profiles.items() if name != ACHIEVED.name}
    if _columns(data) > 1 or len(drawn) < 2:
        return None
    return drawing.ellipsoids(data["time"], drawn, unit=data["unit"], roles={role: role for role in drawn})


def curves(data: dict[str, Any]) -> Figure | None:
    """Draw the semi-axes over time."""
    panels = _panels(data, lambda topic: topic == ELLIPSOIDS)
    return drawing.panel_figure(data["time"], panels, _columns(data)) if panels else None


def motion(data: dict[str, Any]) -> Figure | None:
    """Draw all other curves of the robot over time."""
    panels = _panels(data, lambda topic: topic not in (ELLIPSOIDS, HUMAN_JOINTS))
    return drawing.panel_figure(data["time"], panels, _columns(data)) if panels else None


def diffusion_map(data: dict[str, Any]) -> Figure | None:
    """Draw domains and profiles on their map."""
    if not data["map"]:
        return None
    clouds, lines = data["map"]["domains"], data["map"]["profiles"]
    names = {cloud["name"]: cloud["role"] for cloud in [*clouds, *lines]}
    domains, paths = ({cloud["name"]: cloud["coordinates"] for cloud in sets} for sets in (clouds, lines))
    return drawing.map_figure(domains, paths, data["time"], names)


def learned(data: dict[str, Any]) -> Figure | None:
    """Draw all curves of a learned profile over time."""
    return drawing.panel_figure(data["time"], _panels(data, lambda topic: True))


def _bodies(data: dict[str, Any]) -> Iterator[tuple[dict[str, Any], int, dict[str, Any], dict[str, Array]]]:
    """Yield stage, number in it, body and ellipsoids (n, 3, 3) by role of all bodies with ellipsoids."""
    for stage in data["stages"]:
        for k, body in enumerate(stage["bodies"]):
            if body["ellipsoids"]:
                yield (
                    stage,
                    k,
                    body,
                    {role: six[:, MATRIX].reshape(-1, 3, 3) for role, six in body["ellipsoids"].items()},
                )


def _columns(data: dict[str, Any]) -> int:
    return 2 if any(len(stage["bodies"]) > 1 for stage in data["stages"]) else 1


def _panels(data: dict[str, Any], wanted: Callable[[str], bool]) -> list[Panel]:
    """Return the panels of some topics."""
    return [
        Panel(**panel | {"lines": tuple(Line(**line) for line in panel["lines"])})
        for topic, panels in data["panels"].items() if wanted(topic) for panel in panels
    ]  # fmt: skip
