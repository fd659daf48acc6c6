"""Planning effort: the search budget of placement and planning."""

from dataclasses import dataclass
from typing import Any

from maniport.util.defaults import BATCH_EFFORT, EFFORT
from maniport.util.validation import as_choice


@dataclass(frozen=True)
class Effort:
    """Search budget of placement and planning."""

    candidates: int = 4096  # placements compared by samples
    placement_nodes: int = 60  # nodes per stage of the roadmap of a placement
    nodes: int = 300  # nodes per stage of the roadmap of a plan; up to 2.4 times as many for short paths
    stage: float = 0.55  # longest time between stages at the planning time scale [s]
    rel_tol: float = 1e-4  # smallest relative decrease of the cost for another optimizer step
    relaxation: bool = True  # see maniport.motion.plan.refinement
    pointwise_starts: int = 32  # samples for the best pointwise solution at each placed waypoint
    gap_points: int = 250  # most waypoints at which the feasibility gap is searched
    gap_starts: int = 48  # samples for each of them

    @property
    def of_gap(self) -> dict[str, Any]:
        """Arguments of `maniport.motion.feasibility_gap`."""
        return {"n_points": self.gap_points, "n_starts": self.gap_starts}


FULL, QUICK = EFFORT, BATCH_EFFORT
EFFORTS = {
    FULL: Effort(),
    QUICK: Effort(
        candidates=1024,
        placement_nodes=40,
        nodes=150,
        stage=1.0,
        rel_tol=1e-3,
        relaxation=False,
        pointwise_starts=8,
        gap_points=40,
        gap_starts=16,
    ),
}


def as_effort(value: str) -> Effort:
    """Return the effort of a name."""
    return EFFORTS[as_choice(value, "planning_effort", tuple(EFFORTS))]
