"""From names and files to a state that can be shown."""

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import Arm, load_arm
from maniport.bodies.chain import RIGHT
from maniport.bodies.human import human_arm
from maniport.defaults import AUTO, DAMPING
from maniport.demonstrations import fit_arm, read_recording
from maniport.demonstrations.arm_fit import require_person
from maniport.domain import sample_domain
from maniport.steps import Progress
from maniport.tracking import StartBank
from maniport.tracking.arm_model import require_trackable
from maniport.transfer import load_adapter
from maniport.validation import as_count, as_rotation
from maniport.view.maps import GIVEN, Methods, Refitting, require_drawable
from maniport.view.state import LiveState, Playback, place_tip

TEACHER_SAMPLES, STUDENT_SAMPLES, BANK_SIZE, PLACES = 2048, 4096, 16_384, 32
AT_ONCE = "parallel-transport"
"""The method that is fitted before the page is there: it takes milliseconds."""


def prepare(
    person: str = "myoarm",
    robot: Arm | str | os.PathLike[str] = "panda",
    *,
    recording: str | os.PathLike[str] | None = None,
    side: str = AUTO,
    height: float | None = None,
    adapter: str | os.PathLike[str] | None = None,
    mounting: ArrayLike | None = None,
    random_state: int = 0,
    progress: Progress | None = None,
) -> tuple[LiveState, str, np.ndarray]:
    """Load two arms, sample their domains, and fit the first method; the rest is done while one looks.

    Parameters
    ----------
    person, side, height : optional
        The person's arm, as in `fit_arm`; without a recording "auto" is the right arm.
    robot : Arm, str or path
        An arm, the name of one, or its URDF or MJCF file.
    recording : str or path, optional
        A motion to play, BVH or C3D.
    adapter : str or path, optional
        A fitted adapter to show beside the methods; its regularisation is theirs too, and its mounting the first.
    mounting : array_like, shape (3, 3), optional
        Rotation from the person's trunk frame to the robot's base frame. Default: the adapter's, or the identity.
    random_state : int
        Seed of everything that is drawn.
    progress : callable, optional
        Called with the name of a step and the fraction done.

    Returns
    -------
    state : LiveState
    method : str
        What to show first: the given adapter, or parallel transport, which is there at once; the other methods are
        fitted while the page is looked at.
    mounting : ndarray, shape (3, 3)

    Raises
    ------
    ManiportError
        When an input cannot be used.
    """
    tell = progress or (lambda step, fraction, found="": None)
    seed = as_count(random_state, "random_state", minimum=0)
    require_person(person, side, height)
    given = None if adapter is None else load_adapter(adapter)
    if given is not None:
        require_drawable(given)  # before any long work
    if mounting is None:
        mounting = getattr(given, "mounting", None)
    student = robot if isinstance(robot, Arm) else load_arm(robot)
    require_trackable(student)

    if recording is None:
        teacher = human_arm(person, RIGHT if side == AUTO else side, height)
        motion, playback = teacher.sample(PLACES, seed), None
    else:
        fit = fit_arm(read_recording(recording), person, progress=progress, side=side, height=height)
        teacher, motion, playback = fit.arm, fit.joint_angles, Playback(fit.time, fit.joint_angles)

    tell("get the page ready", 0.0)
    options: dict[str, Any] = {"damping": DAMPING, "floor": None}
    if given is not None and (given.damping, given.floor) != (None, None):
        options = {"damping": given.damping, "floor": given.floor}
    bank = StartBank.build(student, BANK_SIZE, seed)
    domains = sample_domain(teacher, TEACHER_SAMPLES, seed), sample_domain(student, STUDENT_SAMPLES, seed + 1)
    methods = Methods(*domains, given=given, robot=student, bank=bank, **options)
    turn = np.eye(3) if mounting is None else as_rotation(mounting, "mounting", 3)
    shown = GIVEN if given is not None else AT_ONCE
    refitting = Refitting(methods, turn, first=(shown,))
    state = LiveState(teacher, student, refitting, None, bank, playback)

    def place() -> None:
        state.place = place_tip(teacher, motion, refitting.maps[shown], student, bank)

    refitting.before = place
    tell("get the page ready", 1.0, f"{shown}; the place of the path and the other methods follow")
    return state, shown, turn
