"""Draw the demo twice: docs/gain.png shows the person, the robot through positions only, and the robot of maniport.

    python scripts/make_gain_picture.py

All are shown at one waypoint: that at which the ratio of the two forces is the median. Arrows show the force along the
line where the person is strongest, at one scale for both robots.
"""

from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D

import maniport as mp
from make_gallery import small
from maniport.pipeline.capability import Comparison, PlacedMotion
from maniport.pipeline.transfer import mean_rotation
from maniport.report.page.content import ACHIEVED, PERSON, REFERENCE
from maniport.util.validation import Array

PICTURE = Path(__file__).parents[1] / "docs" / "gain.png"
ARROW = 0.35  # length of the longest arrow [m]
HALF = 0.62  # half of the edge of the robots' panels; that of the person is half as large [m]
ELEVATION = 15.0  # of the camera [deg]


def comparison_of(result: mp.TransferResult) -> Comparison:
    """Plan the motion through positions only, as the transfer did."""
    fitted = result.fitted
    human = mp.Transfer.of(fitted.settings.config).read(result.recording)
    robot = replace(fitted.robot, random=deepcopy(fitted.robot.random))
    moved = PlacedMotion(result.motion, (result.arm.placement,))
    rotation = mean_rotation(fitted.maps)
    return Comparison.of(moved, fitted.map(human), robot, fitted.settings, rotation)


def draw(
    axes: Axes3D,
    skeleton: Array,
    line: Array,
    length: float,
    color: str,
    title: str,
    half: float,
) -> None:
    """Draw an arm, with an arrow of two heads along a line at its hand."""
    hand = skeleton[-1]
    axes.plot(*skeleton.T, "o-", color=color, linewidth=4, markersize=5, markerfacecolor="white")
    for sense in (1.0, -1.0):
        change = sense * length * line
        axes.quiver(*hand, *change, color="#D55E00", linewidth=2.2, arrow_length_ratio=0.18)
    center = (skeleton.min(axis=0) + skeleton.max(axis=0)) / 2.0
    axes.set(
        xlim=(center[0] - half, center[0] + half),
        ylim=(center[1] - half, center[1] + half),
        zlim=(center[2] - half, center[2] + half),
    )
    axes.set_box_aspect((1, 1, 1), zoom=1.5)
    azimuth = float(np.degrees(np.arctan2(line[1], line[0]))) + 90.0
    axes.view_init(ELEVATION, azimuth)
    axes.set_axis_off()
    axes.set_title(title, fontsize=9, y=-0.06)


def main() -> None:
    """Transfer the demo and draw it."""
    result = mp.transfer_recording("freeform")
    comparison = comparison_of(result)
    arm = result.arm
    (force,) = [capability for capability in arm.capabilities if capability.kind == "force"]
    assert force.position_only is not None
    assert force.person is not None
    fitted = result.fitted
    human = mp.Transfer.of(fitted.settings.config).read(result.recording)
    direction = fitted.directions(human)[0][0]
    map_rotation = arm.adapter.map_rotation_[:3, :3]
    assert comparison.position_only is not None
    reference = comparison.position_only.directed(0, direction, map_rotation)

    ratio = force.robot / force.position_only
    row = int(np.abs(ratio - np.median(ratio)).argmin())
    scale = ARROW / max(force.robot[row], force.position_only[row])
    rotation = arm.placement.rotation @ map_rotation
    person = arm.fit.arm.skeleton(arm.fit.joint_angles[row])
    person_line = rotation.T @ force.lines[row]
    panels = (
        (
            person,
            person_line,
            ARROW / 2.0,
            PERSON.color,
            f"person: {force.person[row]:.0f} N along the line",
            HALF / 2.0,
        ),
        (
            arm.robot.skeleton(reference.joint_positions[row]),
            reference.lines[row],
            scale * force.position_only[row],
            REFERENCE.color,
            f"robot, positions only: {force.position_only[row]:.0f} N",
            HALF,
        ),
        (
            arm.robot.skeleton(arm.motion.joint_positions[row]),
            force.lines[row],
            scale * force.robot[row],
            ACHIEVED.color,
            f"robot, maniport: {force.robot[row]:.0f} N",
            HALF,
        ),
    )
    figure = Figure(figsize=(7.0, 2.5), dpi=300)
    for i, panel in enumerate(panels):
        axes = figure.add_subplot(1, 3, i + 1, projection="3d")
        draw(axes, *panel)
    figure.subplots_adjust(left=0.0, right=1.0, bottom=0.1, top=1.0, wspace=0.05)
    small(figure, PICTURE)
    print(f"waypoint {row}, at {force.time[row]:.2f} s")


if __name__ == "__main__":
    main()
