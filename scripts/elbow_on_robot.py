"""Why ellipsoids: what is planned for them beside a motion that keeps the person's elbow angle instead.

    python scripts/elbow_on_robot.py --robots panda xarm7 --motions ladder freeform

Three motions for each recording: the main job's; one with the tip on the same path and the elbow turned as the person's
(`maniport.evaluation.ElbowBaseline`); and the same with the path laid as the elbow asks for, shoulder on shoulder.
Prints a table in Markdown. The xArm7 comes from the package example-robot-data.
"""

import argparse
from collections.abc import Iterator

import numpy as np

import maniport as mp
from maniport.demonstrations import shipped_recording
from maniport.evaluation import ElbowBaseline
from maniport.evaluation.elbow import elbow_angle, turned_by
from maniport.evaluation.elbow_row import made_by
from maniport.pipeline import TransferResult
from maniport.thinning import evenly
from maniport.tracking import PlacedPath

POINTS = 150
"""Of a recording, evenly over its frames, at which motions are compared."""
HEAD = "robot", "motion", "what is kept", "d to target", "d to demonstrated", "tip [mm]", "elbow [°]"


def ways(result: TransferResult) -> Iterator[tuple[str, PlacedPath | None, np.ndarray, np.ndarray, np.ndarray]]:
    """Name, place, joint positions (n, dof), errors of the tip (n,) [m] and of the elbow (n,) [rad] of each motion."""
    fit, robot, execution = result.fit, result.robot, result.execution
    rows, placement, turn = evenly(len(result.time), POINTS), execution.placement, result.adapter.turn_
    q, person = execution.motion.joint_positions[rows], fit.joint_angles[rows]
    away = np.linalg.norm(robot.forward(q)[:, :3, 3] - execution.motion.path[rows], axis=1)
    angles = elbow_angle(robot, q, placement.rotation @ turn)
    yield "ellipsoids", placement, q, away, turned_by(angles, elbow_angle(fit.arm, person))
    for name, place in (("elbow", placement), ("elbow, its own place", None)):
        found = ElbowBaseline(fit.arm, person, place).motion(robot, turn)
        yield name, place, found.joint_positions, found.tip_error, found.elbow_error


def lines(result: TransferResult, name: str, recording: str) -> Iterator[str]:
    """Rows of the table: means, of the tip and the elbow median / 95 %."""
    rows, adapter = evenly(len(result.time), POINTS), result.adapter
    target = adapter.student_side(result.target_profile[rows])
    person = adapter.teacher_side(result.demonstrated_profile[rows])
    for kept, placement, q, tip, elbow in ways(result):
        achieved = made_by(q, result.robot, adapter, placement, result.spec)
        means = (f"{mp.spd.distance(one, achieved).mean():.2f}" for one in (target, person))
        cells = (*means, spread(1e3 * tip), spread(np.degrees(np.abs(elbow))))
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
