"""Connects the feasible set of a robot to the transfer methods that use it."""

import copy
from typing import Any

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.motion import FeasibleProjector, SeedBank
from maniport.transfer import DomainAdapter


def with_feasible_set(
    adapter: DomainAdapter,
    robot: Arm | None,
    spec: EllipsoidSpec = VELOCITY,
    bank: SeedBank | None = None,
    random_state: Any = 0,
) -> DomainAdapter:
    """Return an adapter that uses the feasible set of a robot, where its method does and none is set."""
    parameters = adapter.get_params(deep=False)
    if robot is None or parameters.get("projector", robot) is not None or getattr(adapter, "from_samples_", False):
        return adapter
    aware: DomainAdapter = copy.copy(adapter).set_params(
        projector=FeasibleProjector(robot, spec, bank=bank, random_state=random_state)
    )
    return aware
