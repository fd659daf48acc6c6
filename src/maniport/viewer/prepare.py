"""From names and files to the state of the live view."""

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import Arm, ArmGroup, as_group, load_arm, load_arms
from maniport.arms.arm_group import placing_options
from maniport.arms.chain import RIGHT
from maniport.arms.human import human_arm, middle_of
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError, spoken
from maniport.mocap import fit_arms, read_recording
from maniport.mocap.arm_ik import GROUP, require_person
from maniport.motion import SeedBank
from maniport.motion.arm_model import require_trackable
from maniport.transfer import load_adapter
from maniport.util.defaults import AUTO, BOTH, DAMPING
from maniport.util.progress import Progress, no_progress
from maniport.util.validation import Array, as_count, as_rotation
from maniport.viewer.maps import LOADED, Maps, require_drawable
from maniport.viewer.state import Playback, Side, ViewState

TEACHER_SAMPLES = 2048
STUDENT_SAMPLES = 4096
BANK_SIZE = 16_384
AT_ONCE = "parallel-transport"  # The method that is fitted before the page is there: it takes milliseconds
PREFERRED = "length-field"
"""The method that is shown as soon as it is fitted, within some seconds; `maniport transfer` mostly chooses it."""


def prepare(
    person: str = "myoarm",
    robot: Arm | ArmGroup | str | os.PathLike[str] = "panda",
    *,
    recording: str | os.PathLike[str] | None = None,
    side: str = AUTO,
    height: float | None = None,
    adapter: str | os.PathLike[str] | None = None,
    base_rotation: ArrayLike | None = None,
    random_state: int = 0,
    progress: Progress | None = None,
) -> tuple[ViewState, str, Array]:
    """Load arms of person and robot, sample their domains, and fit the first method."""
    tell = progress or no_progress
    seed = as_count(random_state, "random_state", minimum=0)
    both = side == BOTH or isinstance(robot, ArmGroup)
    if both and side not in (AUTO, BOTH):
        raise InvalidInputError(f"{spoken('side')}: the robot has two arms, for both of the person; found {side!r}")
    if both and adapter is not None:
        raise InvalidInputError("an adapter file is one arm's; where both are shown methods are fitted for each")
    if both and isinstance(robot, Arm):
        raise InvalidInputError(f"both arms need a robot with two, such as of maniport.load_arms; found {robot!r}")
    require_person(person, AUTO if both else side, height)
    loaded = None if adapter is None else load_adapter(adapter)
    options: dict[str, Any] = {"damping": DAMPING, "eigenvalue_floor": None}
    if loaded is not None:
        require_drawable(loaded)  # before any long work
        if (loaded.damping, loaded.eigenvalue_floor) != (None, None):
            options = {"damping": loaded.damping, "eigenvalue_floor": loaded.eigenvalue_floor}
    if base_rotation is None:
        base_rotation = getattr(loaded, "base_rotation", None)
    rotation = np.eye(3) if base_rotation is None else as_rotation(base_rotation, "base_rotation", 3)
    group = as_group(robot if isinstance(robot, Arm | ArmGroup) else (load_arms if both else load_arm)(robot))
    if both and len(group.arms) != 2:
        raise InvalidInputError(f"the view of both arms needs two robot arms; place them with {placing_options()}")
    for student in group.arms:
        require_trackable(student)
    persons, motion, time, bases = _person(person, recording, side, height, both, seed, progress)

    tell("Prepare page", 0.0)
    displayed, ready = (LOADED, LOADED) if loaded is not None else (PREFERRED, AT_ONCE)
    sides = []
    for teacher, student, base in zip(persons, group.arms, bases, strict=True):
        bank = SeedBank(student, BANK_SIZE, seed)
        domains = sample_domain(teacher, TEACHER_SAMPLES, seed), sample_domain(student, STUDENT_SAMPLES, seed + 1)
        maps = Maps(
            *domains, loaded=loaded, robot=student, bank=bank, base_rotation=rotation, first=(ready,), **options
        )
        sides.append(Side(teacher, student, maps, bank, base=base))
    playback = None if time is None else Playback(time, np.concatenate(motion, axis=1))
    state = ViewState(group if both else group.arms[0], sides, playback)
    sides[0].maps.before = lambda: state.find_place(motion, ready)
    tell("Prepare page", 1.0, f"{ready}; the placement and the other methods follow")
    return state, displayed, rotation


def _person(
    person: str, recording: Any, side: str, height: float | None, both: bool, seed: int, progress: Progress | None
) -> tuple[tuple[Arm, ...], list[Array], Array | None, Array]:
    """Return the person's arms, joints of each (n, dof), times where they are recorded, and base frames (k, 3)."""
    if recording is None:
        arms = tuple(human_arm(person, own, height) for own in (GROUP if both else (RIGHT if side == AUTO else side,)))
        bases = np.array([[0.0, -middle_of(arm) if both else 0.0, 0.0] for arm in arms])
        return arms, [arm.sample(32, seed) for arm in arms], None, bases
    side = BOTH if both else side
    fits = fit_arms(read_recording(recording), person, progress=progress, side=side, height=height)
    return tuple(fit.arm for fit in fits.arms), [fit.joint_angles for fit in fits.arms], fits.time, fits.bases
