"""The content of a page as a file for the Rerun viewer: arms, their ellipsoids and every curve."""

import os
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.report.page.content import REFERENCE, ROLES, TARGET, Animation, Body
from maniport.spd.ellipsoid import axes
from maniport.util.atomic_io import written_whole
from maniport.util.optional import rerun
from maniport.util.validation import Array

GREY = 190, 196, 204  # Color of arms


def write_scene(path: str | os.PathLike[str], animation: Animation) -> None:
    """Write an animation to a Rerun recording, whole or not at all."""
    package = rerun()
    clocks = {"time": animation.time, **animation.clocks}
    columns = [package.TimeColumn(name, duration=(time - time[0]).tolist()) for name, time in clocks.items()]
    with written_whole(path) as temporary:
        stream = package.RecordingStream("maniport")
        stream.save(temporary, default_blueprint=_layout(package.blueprint, animation))
        for stage in animation.stages:
            home = _place(stage.name)
            stream.log(home, package.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            for k, body in enumerate(stage.bodies):
                own = f"{home}/{k}" if len(stage.bodies) > 1 else home
                _log_arm(package, stream, body, own, columns, animation.size)
        _log_curves(package, stream, animation, columns)
        stream.flush()
        stream.disconnect()


def _layout(blueprint: Any, animation: Animation) -> Any:
    """Lay out scenes side by side, and curves below in tabs."""
    scenes = [blueprint.Spatial3DView(origin=f"/{_place(stage.name)}", name=stage.name) for stage in animation.stages]
    curves = [blueprint.TimeSeriesView(origin=f"/curves/{_place(name)}", name=name) for name in animation.panels]
    rows = [blueprint.Horizontal(*scenes), *([blueprint.Tabs(*curves)] if curves else [])]
    return blueprint.Blueprint(blueprint.Vertical(*rows, row_shares=[3, 2][: len(rows)]), collapse_panels=True)


def _log_arm(package: Any, stream: Any, body: Body, home: str, clocks: list[Any], size: float) -> None:
    end_effectors = body.skeleton[:, -1]
    for role, ellipsoids in body.ellipsoids.items():
        lengths, turns = _drawn(ellipsoids)
        filled = (
            package.components.FillMode.MajorWireframe if role == TARGET.name else package.components.FillMode.Solid
        )
        shape = package.Ellipsoids3D.from_fields(colors=[ROLES[role].rgb], fill_mode=filled)
        stream.log(f"{home}/{role}", shape, static=True)
        columns = package.Ellipsoids3D.columns(half_sizes=size * lengths, centers=end_effectors, quaternions=turns)
        stream.send_columns(f"{home}/{role}", indexes=clocks, columns=columns)
    for k, part in enumerate(body.parts):
        where = f"{home}/links/{k}"
        mesh = package.Mesh3D(vertex_positions=part.points, triangle_indices=part.triangles, albedo_factor=GREY)
        stream.log(where, mesh, static=True)
        turned = package.Transform3D.columns(
            translation=part.poses[:, :3, 3], quaternion=Rotation.from_matrix(part.poses[:, :3, :3]).as_quat()
        )
        stream.send_columns(where, indexes=clocks, columns=turned)
    if not body.parts:
        look = package.LineStrips3D.from_fields(colors=[GREY], radii=[0.012])
        stream.log(f"{home}/skeleton", look, static=True)
        limbs = package.LineStrips3D.columns(strips=list(body.skeleton))
        stream.send_columns(f"{home}/skeleton", indexes=clocks, columns=limbs)
    if body.path is not None:
        line = package.LineStrips3D([body.path], colors=[REFERENCE.rgb], radii=[0.002])
        stream.log(f"{home}/path", line, static=True)


def _log_curves(package: Any, stream: Any, animation: Animation, clocks: list[Any]) -> None:
    for group, panels in animation.panels.items():
        for panel in panels:
            title = f"{panel.title} [{panel.unit}]" if panel.unit else panel.title
            for line in panel.lines:
                where = "/".join(map(_place, filter(None, ("curves", group, title, line.name))))
                color = ROLES[line.role].rgb
                stream.log(where, package.SeriesLines(colors=[color], names=[line.name or title]), static=True)
                scalars = package.Scalars.columns(scalars=line.values)
                stream.send_columns(where, indexes=clocks, columns=scalars)


def _drawn(ellipsoids: Array) -> tuple[Array, Array]:
    """Semi-axes (n, 3) of ellipsoids and their orientations as quaternions x, y, z, w (n, 4)."""
    lengths, directions = axes(ellipsoids)
    directions[..., 0] *= np.sign(np.linalg.det(directions))[:, None]  # axes are lines; rotations are right-handed
    return lengths, Rotation.from_matrix(directions).as_quat()


def _place(name: str) -> str:
    """Return a name as one part of an entity path."""
    return str(rerun().escape_entity_path_part(name))
