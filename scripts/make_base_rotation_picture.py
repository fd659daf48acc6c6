"""Draw the picture of `docs/end_effector.md`: one target ellipsoid at a robot that is mounted in two ways.

python scripts/make_base_rotation_picture.py [PICTURE]
"""

import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import maniport as mp
from make_gallery import small
from maniport.report import figures
from maniport.report.page.content import PERSON, TARGET

MOUNTINGS = {"--base-rotation 0,0,90": (0.0, 0.0, 90.0), "--base-rotation 0,90,0": (0.0, 90.0, 0.0)}
CONFIGURATION = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 2.0, 0.8])  # [rad]
REACHING = np.radians([60.0, 40.0, 0.0, 70.0, 0.0, 0.0, 0.0])


def main(picture: Path) -> None:
    """Draw person and robots in the frame of the person's trunk, with the robot's base rotated back."""
    person = mp.load_arm("myoarm")
    robot = mp.load_arm("panda")
    target = person.manipulability(REACHING)[None]
    lines = {"person": person.skeleton(REACHING)[None]}
    for name, angles in MOUNTINGS.items():
        base_rotation = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
        lines[name] = robot.skeleton(CONFIGURATION)[None] @ base_rotation
    roles = {name: (PERSON if name == "person" else TARGET).name for name in lines}
    figure = figures.arms(lines, dict.fromkeys(lines, target), roles=roles)
    small(figure, picture)


if __name__ == "__main__":
    main(
        Path(
            sys.argv[1]
            if len(sys.argv) > 1
            else Path(__file__).parents[1] / "docs" / "base_rotation.png"
        )
    )
