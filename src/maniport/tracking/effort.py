"""How much is tried before a place or a motion is taken: much for one motion, little where there are thousands."""

from dataclasses import dataclass
from typing import Any

from maniport.defaults import BATCH_EFFORT, EFFORT
from maniport.tracking.plan.refinement import ENOUGH
from maniport.tracking.search.feasible import POINTS as GAP_POINTS
from maniport.tracking.search.feasible import STARTS as GAP_STARTS
from maniport.tracking.search.node_floor import STARTS as FLOOR_STARTS
from maniport.validation import as_choice


@dataclass(frozen=True)
class Detail:
    """How smooth and how fine a motion is while it is planned in slow time.

    Attributes
    ----------
    share : float
        Of the usual smoothness: with less of it motions come nearer to their targets, and take longer once they are
        timed.
    stage : float
        Longest time between stages [s].
    quicker : float
        How many times quicker than usual joints may be, where their limits allow.
    """

    share: float
    stage: float
    quicker: float = 1.0


FIRST, LESS = Detail(1.0, 0.55), Detail(0.1, 0.55)
"""Of the first motion that is planned; with stages twice as long it is 5 % worse. And of one with less smoothness."""
HURRIED = (LESS,)
CALM = (Detail(0.01, 0.25), Detail(0.003, 0.25, 1.5), LESS)
"""Of further ones, where limits make the first one slower or it has many points, and elsewhere."""


@dataclass(frozen=True)
class Effort:
    """How much is tried.

    Attributes
    ----------
    placed_points : int
        At how many points of a path, at most, its ellipsoids count and its node floor is searched while it is placed;
        more than the default take longer and change little.
    candidates, sieve : int
        How many places of a path are compared by a few of its points, and how many of these by more.
    samples : int
        By how many samples of the arm next to each of these points.
    planned : int
        From how many places motions are planned.
    place_stages, place_nodes : int
        Through how many points of the path, and how many postures at each.
    tried : int
        How often every place is moved.
    improved, evaluations : int
        How many of the best are planned anew and moved on, apart from collisions, and how often.
    together : bool
        Whether every place is moved together with its motion instead, in one descent
        (`maniport.tracking.placement.together`).
    weights : int
        Of the two weights on the path by which motions through stages are refined, one after the other, the first ones.
    nodes, most_nodes, pairs : int
        Postures for each stage of a plan; where stages are few more, as many as make so many pairs of neighbors.
    rivals : bool
        Whether other motions compete with the shortest path: the one that goes from each posture to the best next to
        it, one with leaps that the refinement may join, and what is best of all of them, piece by piece.
    first : Detail
        Of the first motion that is planned.
    again : bool
        Whether further ones are planned, `HURRIED` or `CALM`, until one is near its node floor.
    piece : float
        Points that are farther apart in slow time are planned with others between them [s]: else the tip strays there.
    fineness : float
        In how many pieces the search for the time of a motion parts it, as a share of the usual number.
    enough : float
        Share of the cost of a motion that a step of its refinement must bring for another one to follow.
    gives_way : bool
        Whether room and time give way where a tip is far from its path (`maniport.tracking.plan.giving_way`).
    floor_starts : int
        From how many samples the node floor is searched at each point of a path that is placed.
    gap_points, gap_starts : int
        At how many points of a motion the feasibility gap is searched, at most, and from how many samples at each.
    """

    placed_points: int = 250
    candidates: int = 4096
    samples: int = 32
    sieve: int = 64
    planned: int = 4
    place_stages: int = 64
    place_nodes: int = 120
    tried: int = 4
    improved: int = 2
    evaluations: int = 20
    together: bool = False
    weights: int = 2
    nodes: int = 300
    most_nodes: int = 1000
    pairs: int = 25_000_000
    rivals: bool = True
    first: Detail = FIRST
    again: bool = True
    piece: float = 0.16
    fineness: float = 1.0
    enough: float = ENOUGH
    gives_way: bool = True
    floor_starts: int = FLOOR_STARTS
    gap_points: int = GAP_POINTS
    gap_starts: int = GAP_STARTS

    @property
    def of_gap(self) -> dict[str, Any]:
        """How `maniport.tracking.feasibility_gap` is to be searched."""
        return {"n_points": self.gap_points, "n_starts": self.gap_starts}


FULL, QUICK = EFFORT, BATCH_EFFORT
EFFORTS = {
    FULL: Effort(),
    QUICK: Effort(
        placed_points=80,
        candidates=1024,
        samples=12,
        sieve=32,
        planned=2,
        place_stages=40,
        place_nodes=40,
        improved=0,
        together=True,
        weights=1,
        nodes=150,
        most_nodes=150,
        rivals=False,
        first=Detail(0.3, 1.0),
        again=False,
        piece=0.21,
        fineness=0.16,
        enough=1e-3,
        gives_way=False,
        floor_starts=8,
        gap_points=40,
        gap_starts=16,
    ),
}


def as_effort(value: str) -> Effort:
    """Return the effort of a name."""
    return EFFORTS[as_choice(value, "effort", tuple(EFFORTS))]
