"""The domain of a Panda from joint samples, against Peter Corke's Robotics Toolbox."""

from collections.abc import Iterator

import numpy as np
import roboticstoolbox

from .inputs import Array, load
from .measure import Row, duration, faster, race


def rows(quick: bool) -> Iterator[Row]:
    """Joint samples in, ellipsoids of the flange out."""
    n = 2_000 if quick else 100_000
    arm = load("panda")
    joints = arm.sample(n, random_state=0)
    chain = roboticstoolbox.models.Panda().ets(end="panda_link8")  # looked up once: quicker than Panda().jacob0

    def loop() -> Array:
        domain = np.empty((n, 3, 3))
        for i, q in enumerate(joints):
            jacobian = chain.jacob0(q)[:3]
            domain[i] = jacobian @ jacobian.T
        return domain

    error = float(np.abs(arm.manipulability(joints) - loop()).max())
    times = race(lambda: arm.manipulability(joints), loop, 0.5 if quick else 3.0)
    yield faster(
        f"Panda domain of {n:,} ellipsoids from joint samples",
        times,
        "roboticstoolbox jacob0 loop",
        5,
        f"{duration(times.ours / n)} an ellipsoid; largest difference {error:.1g}",
        error < 1e-12,
    )
