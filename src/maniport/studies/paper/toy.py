"""Table I: ellipsoids of the Panda against a rigid transform of themselves (§ IV-B)."""

import numpy as np
from scipy.stats import special_ortho_group

from maniport.spd import mean
from maniport.spd.regularization import Regularization
from maniport.steps import Progress
from maniport.studies.paper.outcome import DRAWS, Draw, Experiment, measure
from maniport.studies.paper.settings import FLOOR, OURS, PAPER, our_adapter, paper_adapter
from maniport.studies.paper.tables import TOY, paper_table
from maniport.studies.paper.trajectories import robot_arm
from maniport.transfer.rigid_map import RigidMap
from maniport.validation import Array

SAMPLES, NEW = 100, 10
STEP = "Table I: toy data"
STRETCH = 2.0
"""The random dispersion ratio and the axes of the random mean lie between 1 / `STRETCH` and `STRETCH`."""

NOTES = (
    "The student's domain: 100 uniform joint samples of the Panda. The teacher's: the same ellipsoids after a random "
    "rotation, change of dispersion and change of mean, each drawn anew for every seed; the paper does not say how "
    "they were drawn. Evaluated on 10 new ellipsoids that went the same way.",
    "The model class contains the truth, so that the right error is 0.",
    "As in the paper, eigenvalues below 1e-4 are lifted to it when the Panda's ellipsoids are drawn, so that none is "
    "singular; no adapter regularises them again, which would leave the model class. No mounting is known.",
)


def toy(seed: int = 0, tell: Progress | None = None, draws: int = DRAWS) -> Experiment:
    """Run the toy experiment on several draws, beginning with seed `seed`."""
    data = [toy_draw(seed + k) for k in range(draws)]
    outcomes = []
    rows = paper_table("I")
    for i, row in enumerate(rows):
        outcomes += measure(paper_adapter(row, floor=None), data, PAPER, row.data, row)
        outcomes += measure(our_adapter(row, damping=None), data, OURS, row.data, row)
        if tell is not None:
            tell(STEP, (i + 0.99) / len(rows))
    return Experiment("toy", STEP, NOTES, tuple(outcomes))


def toy_draw(seed: int) -> Draw:
    """Draw the Panda's ellipsoids and a rigid transform of them, which is the teacher."""
    random = np.random.default_rng(seed)
    arm = robot_arm()
    samples = arm.manipulability(arm.sample(SAMPLES + NEW, random, "uniform"))
    student, new = np.split(Regularization(floor=FLOOR).apply(samples, "samples"), [SAMPLES])
    away = RigidMap(mean(student), _random_mean(random), _rotation(random), float(_stretch(random)))
    return Draw(seed, away.apply(student), student, {TOY[0]: (away.apply(new), new)})


def _random_mean(random: np.random.Generator) -> Array:
    axes = _rotation(random)
    return np.asarray((axes * _stretch(random, 3)) @ axes.T)


def _rotation(random: np.random.Generator) -> Array:
    return np.asarray(special_ortho_group.rvs(3, random_state=random))


def _stretch(random: np.random.Generator, size: int | None = None) -> Array:
    return np.exp(random.uniform(-np.log(STRETCH), np.log(STRETCH), size))
