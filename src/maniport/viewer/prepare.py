"""From options and files to the state of the live view."""

from pathlib import Path
from typing import Any

import numpy as np

from maniport.arms import Arm, ArmGroup, as_group
from maniport.arms.arm_group import placing_options
from maniport.arms.chain import RIGHT
from maniport.arms.human import human_arm, middle_of
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError
from maniport.mocap import fit_arms, read_recording
from maniport.mocap.arm_ik import GROUP, require_person
from maniport.motion import SeedBank
from maniport.motion.arm_model import require_trackable
from maniport.pipeline.config import Config
from maniport.pipeline.settings import load_robot
from maniport.transfer import load_adapter
from maniport.util.defaults import AUTO, BOTH, DAMPING
from maniport.util.process import in_background
from maniport.util.progress import Progress, no_progress
from maniport.util.validation import Array
from maniport.viewer.state import LOADED, Maps, Playback, Side, ViewState

TEACHER_SAMPLES = 2048
STUDENT_SAMPLES = 4096
BANK_SIZE = 16_384
AT_ONCE = "parallel-transport"  # The method that is fitted before the page is there: it takes milliseconds
PREFERRED = "length-field"  # Follows within some seconds; `maniport transfer` mostly chooses it


def prepare(
    config: Config,
    recording: str | Path | None = None,
    adapter: str | Path | None = None,
    progress: Progress = no_progress,
) -> tuple[ViewState, str, Array]:
    """Load arms of person and robot, sample their domains, and fit the first method.

    Returns the state, the method that is displayed and the base rotation.
    """
    side, seed, robot = config.side, config.seed, load_robot(config)
    group, both = as_group(robot), isinstance(robot, ArmGroup)
    if both and side not in (AUTO, BOTH):
        raise InvalidInputError(f"--side: the robot has two arms, for both of the person; found {side!r}")
    if both and len(group) != 2:
        raise InvalidInputError(f"the view of both arms needs two robot arms; place them with {placing_options()}")
    if both and adapter is not None:
        raise InvalidInputError("an adapter file is one arm's; where both are shown methods are fitted for each")
    require_person(config.person, AUTO if both else side)
    loaded = None if adapter is None else load_adapter(adapter)
    damping, base_rotation = DAMPING, None
    if loaded is not None:
        if (d := len(loaded.teacher_mean_)) != 3:
            raise InvalidInputError(f"the adapter maps {d}×{d} ellipsoids; the live view shows 3×3 ones")
        damping, base_rotation = loaded.damping or damping, loaded.base_rotation
    if base_rotation is None or config.base_rotation != Config.base_rotation:
        base_rotation = config.rotation
    rotation = np.asarray(base_rotation, dtype=float)
    for student in group.arms:
        require_trackable(student)
    persons, motion, time, bases = _person(config, both, recording, seed, progress)

    progress("Prepare page", 0.0)
    sides = []
    for teacher, student, base in zip(persons, group.arms, bases, strict=True):
        bank = SeedBank(student, BANK_SIZE, seed)
        domains = sample_domain(teacher, TEACHER_SAMPLES, seed), sample_domain(student, STUDENT_SAMPLES, seed + 1)
        sides.append(
            Side(teacher, student, Maps(*domains, loaded=loaded, bank=bank, robot=student, damping=damping), bank, base)
        )
    playback = None if time is None else Playback(time, np.concatenate(motion, axis=1))
    state = ViewState(robot, sides, playback)
    displayed, ready = (LOADED, LOADED) if loaded is not None else (PREFERRED, AT_ONCE)
    state.places = in_background(state.find_places, motion, [side.maps.get(ready, rotation) for side in sides])
    progress("Prepare page", 1.0, f"{ready}; the placement follows")
    return state, displayed, rotation


def _person(
    config: Config, both: bool, recording: Any, seed: int, progress: Progress
) -> tuple[tuple[Arm, ...], list[Array], Array | None, Array]:
    """Return the person's arms, joints of each (n, dof), times where they are recorded, and base frames (k, 3)."""
    side = BOTH if both else config.side
    if recording is None:
        arms = tuple(human_arm(config.person, own) for own in (GROUP if both else (RIGHT if side == AUTO else side,)))
        bases = np.array([[0.0, -middle_of(arm) if both else 0.0, 0.0] for arm in arms])
        return arms, [arm.sample(32, seed) for arm in arms], None, bases
    fits = fit_arms(read_recording(recording), config.person, progress=progress, side=side)
    return tuple(fit.arm for fit in fits.arms), [fit.joint_angles for fit in fits.arms], fits.time, fits.bases
