"""The main job as one function: recording in, frozen result out."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, Arm, EllipsoidSpec, load_arm
from maniport.mocap import Recording
from maniport.mocap.arm_ik import require_person
from maniport.motion import PlanControl
from maniport.pipeline.follow import controls
from maniport.pipeline.learned import LearnedProfile
from maniport.pipeline.result import TransferResult
from maniport.pipeline.turns import facing
from maniport.pipeline.work import DEMONSTRATED, FREE, Job
from maniport.spd.regularization import Regularization
from maniport.transfer import METHODS, DomainAdapter, method_of
from maniport.util.defaults import AUTO, DAMPING, KEEP, METHOD, PERSON, ROBOT, STUDENT_SAMPLES, TEACHER_SAMPLES
from maniport.util.progress import Progress, no_progress
from maniport.util.validation import as_choice, as_count, as_rotation

ORIENTATIONS = FREE, DEMONSTRATED, "constant"  # How the robot's tip may be turned


def transfer_recording(
    recording: Recording | LearnedProfile | str | Path,
    person: str = PERSON,
    robot: Arm | str | Path = ROBOT,
    method: str | DomainAdapter = METHOD,
    *,
    spec: EllipsoidSpec = VELOCITY,
    markers: Mapping[str, Sequence[str]] | None = None,
    side: str = AUTO,
    height: float | None = None,
    smooth: str | float = AUTO,
    jumps: str = KEEP,
    base_rotation: ArrayLike | None = None,
    damping: float | None = DAMPING,
    eigenvalue_floor: float | None = None,
    n_teacher: int = TEACHER_SAMPLES,
    n_student: int = STUDENT_SAMPLES,
    move: bool = True,
    orientation: str | ArrayLike = FREE,
    random_state: int = 0,
    progress: Progress | None = None,
    **control: Any,
) -> TransferResult:
    """Turn a recording of a person's arm into the motion of a robot that makes the target ellipsoids.

    Parameters
    ----------
    recording : Recording, LearnedProfile, str or Path
        A recording, a file of one, or what `maniport.learn` made of several, for which the next six are known.
    person, markers, side, height, smooth, jumps : optional
        The model of the human arm, points of the recording by role, which arm of the person, the body height [m], what
        is done about jitter and leaps; see `fit_arm`.
    robot : Arm, str or Path
        An arm, the name of one, or its URDF or MJCF file.
    method : str or DomainAdapter
        How the domains are mapped: a name in `maniport.transfer.METHODS`, an adapter, of which a clone is fitted, or
        "auto": the length field if it passes its checks, else parallel transport; see `maniport.evaluation.choose`.
    spec : EllipsoidSpec
        Which ellipsoids.
    base_rotation : array_like, shape (3, 3), optional
        Rotation from the person's trunk frame (x forward, y left, z up) to the robot's base frame. Default: the
        identity; the robot then faces where the person faces.
    damping, eigenvalue_floor : float, optional
        Regularization of singular ellipsoids; see `maniport.spd.regularization`.
    n_teacher, n_student : int
        Sizes of the sampled domains, at least 2.
    move : bool
        Whether the robot shall follow; False ends with its target ellipsoids.
    orientation : {"free", "demonstrated", "constant"} or array_like of shape (3,)
        How the robot's tip is turned: as serves the ellipsoids best, like the person's hand, like that at the start, or
        z in a direction of the base frame. See `maniport.arms.human.hand_rotations`, `orientation_axes`, `orientation_weight`.
    random_state, progress : optional
        Seed of everything that is drawn; called with the name of a step and the fraction done.
    **control
        Options of the planner, such as position_tolerance, speed_scale or home, or of the tracker, such as tasks and limits
        of one's own. See `maniport.pipeline.follow.follow`.

    Raises
    ------
    ManiportError
        When an input cannot be used.
    """
    whose = {"person": person, "markers": markers, "side": side, "height": height, "smooth": smooth, "jumps": jumps}
    job = checked(
        whose, robot if isinstance(robot, Arm) else load_arm(robot), method, control, spec=spec, base_rotation=base_rotation,
        damping=damping, eigenvalue_floor=eigenvalue_floor, n_teacher=n_teacher, n_student=n_student, move=move, orientation=orientation,
        random_state=random_state, progress=progress,
    )  # fmt: skip
    return job.run(recording)


def checked(
    whose: Mapping[str, Any],
    robot: Arm,
    method: str | DomainAdapter,
    control: Mapping[str, Any],
    *,
    spec: EllipsoidSpec = VELOCITY,
    base_rotation: ArrayLike | None = None,
    damping: float | None = DAMPING,
    eigenvalue_floor: float | None = None,
    n_teacher: int = TEACHER_SAMPLES,
    n_student: int = STUDENT_SAMPLES,
    move: bool = True,
    orientation: str | ArrayLike = FREE,
    random_state: int = 0,
    progress: Progress | None = None,
) -> Job:
    """Check what `transfer_recording` is asked for, of which these are the parameters, before any long work."""
    require_person(**{name: value for name, value in whose.items() if name != "markers"})
    seed = as_count(random_state, "random_state", minimum=0)
    turn = np.eye(3) if base_rotation is None else as_rotation(base_rotation, "base_rotation", 3)
    return Job(
        whose,
        robot,
        _adapter(method, seed, {"damping": damping, "eigenvalue_floor": eigenvalue_floor, "base_rotation": turn}),
        spec,
        turn,
        (as_count(n_teacher, "n_teacher", minimum=2), as_count(n_student, "n_student", minimum=2)),
        orientation,
        checked_control(robot, control, orientation, move),
        move,
        seed,
        progress or no_progress,
    )


def _adapter(method: str | DomainAdapter, seed: int, shared: dict[str, Any]) -> DomainAdapter | dict[str, Any]:
    """Make an unfitted adapter, or return what that one will get which is to be chosen."""
    Regularization(shared["damping"], shared["eigenvalue_floor"])
    if isinstance(method, str) and as_choice(method, "method", (AUTO, *METHODS)) == AUTO:
        return shared
    return method_of(method, random_state=seed, **shared)


def checked_control(robot: Arm, given: Mapping[str, Any], orientation: str | ArrayLike, move: bool) -> dict[str, Any]:
    """Options of the motion, looked up for the robot where it shall move; raise what says which is wrong."""
    planning, tracking = controls(given)
    settings = PlanControl(**planning)
    if isinstance(orientation, str):
        as_choice(orientation, "orientation", ORIENTATIONS)
    else:
        facing(orientation, settings.orientation_axes)
    if not move:
        return dict(given)
    ready = settings.resolved(robot)
    return {**{one.name: getattr(ready, one.name) for one in fields(ready)}, **tracking}
