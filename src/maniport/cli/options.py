"""The options that several verbs share, and what their words mean."""

from pathlib import Path
from typing import Annotated, Any

import typer

from maniport.errors import InvalidInputError

Seed = Annotated[int, typer.Option("--seed", help="Seed of everything that is drawn.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the numbers as JSON, and nothing else.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors and what --json prints.")]
Person = Annotated[str, typer.Option("--person", help="Model of the human arm: myoarm or rhuman.")]
Robot = Annotated[str, typer.Option("--robot", help="Name of an arm, or its URDF or MJCF file.")]
Frame = Annotated[str | None, typer.Option("--frame", help="Frame at the tip of the arm.")]
Method = Annotated[
    str, typer.Option("--method", help="icp, parallel-transport, nearest-neighbor, recentring, raw-copy.")
]
Kind = Annotated[str, typer.Option("--kind", help="velocity or force ellipsoids.")]
Part = Annotated[str, typer.Option("--part", help="translation, rotation or full.")]
Damping = Annotated[float, typer.Option("--damping", help="Relative damping of singular ellipsoids; 0 for none.")]
Floor = Annotated[float | None, typer.Option("--floor", help="Lift eigenvalues below it, instead of damping.")]
Mounting = Annotated[
    tuple[float, float, float],
    typer.Option("--mounting", help="Roll, pitch, yaw [deg] from the teacher's base frame to the student's."),
]
Tempo = Annotated[float, typer.Option("--tempo", help="Speed of the robot's motion; 1 is the person's own.")]


def regularization(damping: float, floor: float | None) -> tuple[float | None, float | None]:
    """Return damping and floor as the library takes them: one of them, or neither."""
    if floor is not None:
        return None, floor
    return (None if damping == 0 else damping), None


def rotation(mounting: tuple[float, float, float]) -> Any:
    """Rotation matrix from roll, pitch, yaw [deg] about fixed axes, as in URDF."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("xyz", mounting, degrees=True).as_matrix()


def require_npz(path: Path) -> None:
    """Raise unless a file's name ends in .npz."""
    if path.suffix != ".npz":
        raise InvalidInputError(f"output must be an .npz file; found {str(path)!r}")
