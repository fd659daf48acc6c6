"""The content of a page as a file for the Rerun viewer: arms, their ellipsoids and every curve."""

import os
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.report.page.content import REFERENCE, ROLES, TARGET, Animation, Body
from maniport.spd.ellipsoid import axes
from maniport.util.atomic_io import written_whole
from maniport.util.optional import rerun

GREY = 190, 196, 204  # Color of arms


def write_scene(path: str | os.PathLike[str], animation: Animation) -> None:
    """Write an animation to a Rerun recording, whole or not at all."""
    package = rerun()
    place = package.escape_entity_path_part  # a name as one part of an entity path
    clocks = {"time": animation.time, **animation.clocks}
    columns = [package.TimeColumn(name, duration=(time - time[0]).tolist()) for name, time in clocks.items()]
    with written_whole(path) as temporary:
        stream = package.RecordingStream("maniport")
        stream.save(temporary)
        for stage in animation.stages:
            home = place(stage.name)
            stream.log(home, package.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            for k, body in enumerate(stage.bodies):
                where = f"{home}/{k}" if len(stage.bodies) > 1 else home
                _log_arm(package, stream, body, where, columns, animation.size)
        for topic, panels in animation.panels.items():
            for panel in panels:
                title = f"{panel.title} [{panel.unit}]" if panel.unit else panel.title
                for line in panel.lines:
                    where = "/".join(map(place, filter(None, ("curves", topic, title, line.name))))
                    look = package.SeriesLines(colors=[ROLES[line.role].rgb], names=[line.name or title])
                    stream.log(where, look, static=True)
                    stream.send_columns(where, indexes=columns, columns=package.Scalars.columns(scalars=line.values))
        stream.flush()
        stream.disconnect()


def _log_arm(package: Any, stream: Any, body: Body, home: str, clocks: list[Any], size: float) -> None:
    def log(where: str, look: Any, columns: Any) -> None:
        stream.log(f"{home}/{where}", look, static=True)
        stream.send_columns(f"{home}/{where}", indexes=clocks, columns=columns)

    fill = package.components.FillMode
    for role, ellipsoids in body.ellipsoids.items():
        lengths, directions = axes(ellipsoids)
        directions[..., 0] *= np.sign(np.linalg.det(directions))[:, None]  # axes are lines; rotations are right-handed
        mode = fill.MajorWireframe if role == TARGET.name else fill.Solid
        look = package.Ellipsoids3D.from_fields(colors=[ROLES[role].rgb], fill_mode=mode)
        turns = Rotation.from_matrix(directions).as_quat()
        centers = body.skeleton[:, -1]
        log(role, look, package.Ellipsoids3D.columns(half_sizes=size * lengths, centers=centers, quaternions=turns))
    for k, part in enumerate(body.parts):
        mesh = package.Mesh3D(vertex_positions=part.points, triangle_indices=part.triangles, albedo_factor=GREY)
        turns = Rotation.from_matrix(part.poses[:, :3, :3]).as_quat()
        log(f"links/{k}", mesh, package.Transform3D.columns(translation=part.poses[:, :3, 3], quaternion=turns))
    if not body.parts:
        look = package.LineStrips3D.from_fields(colors=[GREY], radii=[0.012])
        log("skeleton", look, package.LineStrips3D.columns(strips=list(body.skeleton)))
    if body.path is not None:
        line = package.LineStrips3D([body.path], colors=[REFERENCE.rgb], radii=[0.002])
        stream.log(f"{home}/path", line, static=True)
