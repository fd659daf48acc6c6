"""How a person's way of moving becomes a robot's: options of the verbs that transfer a recording."""

from typing import Any

from maniport.cli.application import (
    Damping,
    Floor,
    Height,
    Kind,
    Leaps,
    Method,
    Mounting,
    Part,
    Person,
    Seed,
    Side,
    Smooth,
    regularization,
    rotation,
)
from maniport.cli.groups import group
from maniport.defaults import AUTO, BATCH_METHOD, DAMPING, KEEP, METHOD, PERSON


def _options(
    person: Person = PERSON,
    side: Side = AUTO,
    height: Height = None,
    smooth: Smooth = AUTO,
    leaps: Leaps = KEEP,
    method: Method = METHOD,
    kind: Kind = "velocity",
    part: Part = "translation",
    damping: Damping = DAMPING,
    floor: Floor = None,
    mounting: Mounting = (0.0, 0.0, 0.0),
    seed: Seed = 0,
) -> None:
    """Nothing: its parameters are the options."""


def _job(
    kind: str,
    part: str,
    damping: float,
    floor: float | None,
    mounting: tuple[float, float, float],
    seed: int,
    **given: Any,
) -> dict[str, Any]:
    """The options as `maniport.transfer_recording` takes them."""
    from maniport.bodies import EllipsoidSpec

    rho, lowest = regularization(damping, floor)
    ready = {"spec": EllipsoidSpec(kind, part), "mounting": rotation(mounting), "random_state": seed}
    return {**given, **ready, "damping": rho, "floor": lowest}


transfers = group("job", _options, _job)
"""Gives a verb that has a parameter `job` these options."""

transfers_many = group("job", _options, _job, method=BATCH_METHOD)
"""The same for verbs that transfer many recordings."""
