"""Draw the five pictures of `docs/manipulability.md` with planar arms.

python scripts/make_concept_pictures.py [FOLDER]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from scipy.optimize import minimize

import maniport as mp
from make_gallery import small
from maniport.report.figures import TEXT, column_figure
from maniport.report.page.content import ACHIEVED, PERSON, REFERENCE, TARGET
from maniport.util.validation import Array

FOLDER = Path(__file__).parents[1] / "docs" / "manipulability"
HUMAN_LINKS = (0.31, 0.26)  # upper arm and forearm [m]
ROBOT_LINKS = (0.2, 0.2, 0.2, 0.15)  # [m]
BENT = np.radians([-60.0, 110.0])
STRETCHED = np.radians([10.0, 8.0])
RAISED = np.radians([-20.0, 75.0])
HAND_SCALE = 0.55  # length of a semi-axis in the picture [m] for 1 m/s per rad/s
FORCE_SCALE = 0.045  # length of a semi-axis in the picture [m] for 1 N per N m


def planar_arm(name: str, lengths: tuple[float, ...]) -> mp.Arm:
    """Return an arm whose joints all turn about the z axis."""
    rows = [(0.0, 0.0, length, 0.0) for length in lengths]
    return mp.Arm.from_dh(name, rows)


def ellipse_of(arm: mp.Arm, joint_positions: Array) -> Array:
    """Return the manipulability (2, 2) of velocities in the plane."""
    jacobian = arm.jacobian(joint_positions)[:2]
    return np.asarray(jacobian @ jacobian.T)


def hand_of(arm: mp.Arm, joint_positions: Array) -> Array:
    """Return the position (2,) of the hand [m]."""
    return np.asarray(arm.forward(joint_positions)[:2, 3])


def draw_arm(axes: Axes, arm: mp.Arm, joint_positions: Array, color: str) -> None:
    """Draw links and joints."""
    points = arm.skeleton(joint_positions)[:, :2]
    axes.plot(points[:, 0], points[:, 1], color=color, linewidth=4, solid_capstyle="round")
    axes.plot(points[:-1, 0], points[:-1, 1], "o", color="white", markeredgecolor=color)


def draw_ellipse(
    axes: Axes, center: Array, matrix: Array, scale: float, color: str, style: str = "-"
) -> None:
    """Draw the ellipse with the semi-axes √λ of a matrix."""
    values, vectors = np.linalg.eigh(matrix)
    lengths = 2.0 * scale * np.sqrt(values)
    angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
    outline = Ellipse(tuple(center), lengths[1], lengths[0], angle=angle)
    outline.set(facecolor="none", edgecolor=color, linewidth=1.6, linestyle=style)
    axes.add_patch(outline)


def draw_arrow(axes: Axes, start: Array, change: Array, color: str) -> None:
    """Draw an arrow."""
    style = {"arrowstyle": "-|>", "color": color, "linewidth": 1.6}
    end = start + change
    axes.annotate("", xy=tuple(end), xytext=tuple(start), arrowprops=style)
    axes.update_datalim([tuple(end)])  # an annotation does not change the limits
    axes.autoscale_view()


def panels(count: int) -> tuple[Figure, list[Axes]]:
    """Return a figure with axes side by side, without frames and with equal scales."""
    figure = column_figure(2.1, columns=2)
    axes = list(np.atleast_1d(figure.subplots(1, count)))
    for plot in axes:
        plot.set_aspect("equal")
        plot.set_axis_off()
    return figure, axes


def write_label(axes: Axes, text: str) -> None:
    """Write what a panel shows below it."""
    axes.set_title(text, fontsize=TEXT + 1, y=-0.12)


def joint_velocities(folder: Path) -> None:
    """Picture 1: what each joint alone does to the hand, at 1 rad/s."""
    arm = planar_arm("person", HUMAN_LINKS)
    figure, plots = panels(2)
    jacobian = arm.jacobian(BENT)[:2]
    hand = hand_of(arm, BENT)
    for joint, name in enumerate(("shoulder", "elbow")):
        draw_arm(plots[joint], arm, BENT, PERSON.color)
        draw_arrow(plots[joint], hand, HAND_SCALE * jacobian[:, joint], TARGET.color)
        speed = float(np.linalg.norm(jacobian[:, joint]))
        write_label(plots[joint], f"the {name} turns at 1 rad/s: the hand moves at {speed:.2f} m/s")
    small(figure, folder / "1_joints.png")


def velocity_ellipse(folder: Path) -> None:
    """Picture 2: hand velocities of joint velocities of norm 1."""
    arm = planar_arm("person", HUMAN_LINKS)
    figure, plots = panels(2)
    angles = np.linspace(0.0, 2.0 * np.pi, 33)[:-1]
    velocities = np.stack([np.cos(angles), np.sin(angles)])
    draw_arm(plots[1], arm, BENT, PERSON.color)
    hand = hand_of(arm, BENT)
    motions = HAND_SCALE * arm.jacobian(BENT)[:2] @ velocities
    for change in motions.T:
        draw_arrow(plots[1], hand, change, "#BBBBBB")
    draw_ellipse(plots[1], hand, ellipse_of(arm, BENT), HAND_SCALE, PERSON.color)
    for velocity in velocities.T:
        draw_arrow(plots[0], np.zeros(2), velocity, "#BBBBBB")
    draw_ellipse(plots[0], np.zeros(2), np.eye(2), 1.0, PERSON.color)
    plots[0].set(xlim=(-1.6, 1.6), ylim=(-1.2, 1.2))
    write_label(plots[0], "joint velocities of norm 1")
    write_label(plots[1], "velocities of the hand: the ellipse of M = J Jᵀ")
    small(figure, folder / "2_ellipse.png")


def singular_arm(folder: Path) -> None:
    """Picture 3: the ellipse becomes flat as the arm stretches."""
    arm = planar_arm("person", HUMAN_LINKS)
    figure, plots = panels(3)
    for plot, joint_positions in zip(plots, (BENT, RAISED, STRETCHED), strict=True):
        matrix = ellipse_of(arm, joint_positions)
        draw_arm(plot, arm, joint_positions, PERSON.color)
        draw_ellipse(plot, hand_of(arm, joint_positions), matrix, HAND_SCALE, PERSON.color)
        shortest = float(np.sqrt(np.linalg.eigvalsh(matrix)[0]))
        write_label(plot, f"shortest semi-axis {shortest:.2f} m/s per rad/s")
    small(figure, folder / "3_singular.png")


def force_and_speed(folder: Path) -> None:
    """Picture 4: a stretched arm is fast where a bent arm is strong."""
    arm = planar_arm("person", HUMAN_LINKS)
    figure, plots = panels(2)
    for plot, joint_positions, name in zip(
        plots, (BENT, RAISED), ("bent", "half stretched"), strict=True
    ):
        matrix = ellipse_of(arm, joint_positions)
        hand = hand_of(arm, joint_positions)
        draw_arm(plot, arm, joint_positions, PERSON.color)
        draw_ellipse(plot, hand, matrix, HAND_SCALE, PERSON.color)
        draw_ellipse(plot, hand, np.linalg.inv(matrix), FORCE_SCALE, REFERENCE.color, "--")
        speed = float(np.sqrt(np.linalg.eigvalsh(matrix)[1]))
        force = float(1.0 / np.sqrt(np.linalg.eigvalsh(matrix)[0]))
        write_label(plot, f"{name}: up to {speed:.2f} m/s per rad/s, {force:.1f} N per N m")
    small(figure, folder / "4_force_and_speed.png")


def follower(arm: mp.Arm, hand: Array, target: Array | None, start: Array) -> Array:
    """Return joint positions that reach the hand's position, near an ellipse or near the start."""

    def cost(joint_positions: Array) -> float:
        if target is None:
            return float(np.sum((joint_positions - start) ** 2))
        damping = 1e-4 * np.eye(2)
        achieved = ellipse_of(arm, joint_positions)
        return mp.spd.distance(achieved + damping, target + damping) ** 2

    def error(joint_positions: Array) -> Array:
        return hand_of(arm, joint_positions) - hand

    constraint = {"type": "eq", "fun": error}
    found = minimize(cost, start, constraints=constraint, method="SLSQP", options={"maxiter": 500})
    assert found.success, found.message
    return np.asarray(found.x)


def person_and_robot(folder: Path) -> None:
    """Picture 5: two robot motions through the same position, without and with the ellipse."""
    person = planar_arm("person", HUMAN_LINKS)
    robot = planar_arm("robot", ROBOT_LINKS)
    hand = hand_of(person, BENT)
    target = ellipse_of(person, BENT)
    start = np.radians([-80.0, 60.0, 60.0, 60.0])
    position_only = follower(robot, hand, None, start)
    adapted = follower(robot, hand, target, position_only)

    figure, plots = panels(3)
    draw_arm(plots[0], person, BENT, PERSON.color)
    draw_ellipse(plots[0], hand, target, HAND_SCALE, PERSON.color)
    write_label(plots[0], "person")
    for plot, joint_positions, name in zip(
        plots[1:], (position_only, adapted), ("robot, positions only", "robot"), strict=True
    ):
        matrix = ellipse_of(robot, joint_positions)
        draw_arm(plot, robot, joint_positions, ACHIEVED.color)
        draw_ellipse(plot, hand, target, HAND_SCALE, PERSON.color, "--")
        draw_ellipse(plot, hand, matrix, HAND_SCALE, ACHIEVED.color)
        write_label(plot, f"{name}: distance {mp.spd.distance(matrix, target):.2f}")
    small(figure, folder / "5_person_and_robot.png")


def main(folder: Path) -> None:
    """Draw all pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    for draw in (
        joint_velocities,
        velocity_ellipse,
        singular_arm,
        force_and_speed,
        person_and_robot,
    ):
        draw(folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
