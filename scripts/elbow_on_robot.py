"""Why ellipsoids: what is planned for them beside a motion that keeps the person's elbow angle instead.

    python scripts/elbow_on_robot.py --robots panda xarm7 --motions ladder freeform

Three motions for each recording: the main job's; one with the tip on the same path and the elbow turned as the person's
(`maniport.studies.elbow.keep_elbow`); and the same with the path laid as the elbow asks for: shoulder on shoulder,
scaled by nine tenths of the ratio of the arms' lengths. Prints a table in Markdown. A recording
takes about 80 s of one core for each robot. The xArm7 comes from the package example-robot-data.
"""

import argparse
from collections.abc import Iterator

import numpy as np

import maniport as mp
from maniport.bodies import Arm
from maniport.demonstrations import shipped_recording
from maniport.evaluation.elbow import elbow_angle, elbow_frames, turned_by
from maniport.pipeline import TransferResult
from maniport.studies.elbow import keep_elbow
from maniport.telling.page.motions import turn_of
from maniport.thinning import evenly

POINTS = 150
"""Of a recording, evenly over its frames, at which motions are compared."""
STRETCH = 0.9
"""Of the ratio of the arms' lengths: robots with offsets at the elbow do not stretch as people do."""
HEAD = "robot", "motion", "what is kept", "d to target", "d to demonstrated", "tip [mm]", "elbow [°]"


def ways(result: TransferResult) -> Iterator[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
    """Name, joint positions (n, dof), tip path (n, 3) and turn of the frame (3, 3) of each motion."""
    fit, robot, motion = result.fit, result.robot, result.execution.motion
    rows = evenly(len(result.time), POINTS)
    angles, turn = elbow_angle(fit.arm, fit.joint_angles[rows]), turn_of(result)
    yield "ellipsoids", motion.joint_positions[rows], motion.path[rows], turn
    yield "elbow", keep_elbow(robot, motion.path[rows], angles, turn), motion.path[rows], turn
    shoulders = fit.arm.point_positions(fit.joint_angles[rows], [elbow_frames(fit.arm)[0]])[:, 0]
    hands = fit.arm.forward(fit.joint_angles[rows])[:, :3, 3] - shoulders
    rest = robot.point_positions(np.clip(np.zeros(robot.dof), robot.lower, robot.upper), elbow_frames(robot)[:1])[0]
    path = rest + STRETCH * reach(robot) / reach(fit.arm) * hands @ result.mounting.T
    yield "elbow, its own place", keep_elbow(robot, path, angles, result.mounting), path, result.mounting


def reach(arm: Arm) -> float:
    """Lengths from shoulder to elbow, to wrist, to tip, together [m]."""
    q = np.clip(np.zeros(arm.dof), arm.lower, arm.upper)
    corners = np.vstack([arm.point_positions(q, elbow_frames(arm)), arm.forward(q)[:3, 3]])
    return float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())


def lines(result: TransferResult, name: str, recording: str) -> Iterator[str]:
    """Rows of the table: means, of the tip and the elbow median / 95 %."""
    rows, adapter, robot = evenly(len(result.time), POINTS), result.adapter, result.robot
    angles = elbow_angle(result.fit.arm, result.fit.joint_angles[rows])
    for kept, q, path, turn in ways(result):
        achieved, turned = robot.manipulability(q), turn @ result.mounting.T
        damping = result.execution.motion.damping
        target = turned @ result.target_profile[rows] @ turned.T
        person = turn @ adapter.teacher_side(result.demonstrated_profile[rows]) @ turn.T
        to_target = mp.spd.distance(damping.apply(target), damping.apply(achieved))
        to_person = mp.spd.distance(person, adapter.student_side(achieved))
        tip = 1e3 * np.linalg.norm(robot.forward(q)[:, :3, 3] - path, axis=1)
        elbow = np.degrees(np.abs(turned_by(elbow_angle(robot, q, turn), angles)))
        cells = f"{to_target.mean():.2f}", f"{to_person.mean():.2f}", spread(tip), spread(elbow)
        yield f"| {' | '.join((name, recording, kept, *cells))} |"


def spread(values: np.ndarray) -> str:
    """Median and 95th percentile of those that are known."""
    return " / ".join(f"{value:.1f}" for value in np.nanpercentile(values, [50.0, 95.0]))


def main() -> None:
    """Print the table, row by row."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", nargs="+", default=["panda", "xarm7"], choices=["panda", "xarm7"])
    parser.add_argument("--motions", nargs="+", default=["ladder", "freeform"], choices=["ladder", "freeform"])
    given = parser.parse_args()
    print(f"| {' | '.join(HEAD)} |", f"|{'---|' * len(HEAD)}", sep="\n", flush=True)
    for name in given.robots:
        robot = mp.load_arm(name)
        for recording in given.motions:
            result = mp.transfer_recording(shipped_recording(recording), robot=robot)
            for line in lines(result, name, recording):
                print(line, flush=True)


if __name__ == "__main__":
    main()
