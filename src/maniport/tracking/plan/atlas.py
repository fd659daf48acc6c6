"""Samples of an arm by where their tip is, and postures with the tip at a given place that come of them.

Many arms turn as a whole about the axis of their first joint: as q₁ changes by α, tip and ellipsoid turn by α about it.
The samples of such an arm count for all its turns, so that two coordinates tell them apart, beside and along the axis,
instead of three. Joints that change neither tip nor ellipsoid, such as the last of a Panda, stay in the middle.
"""

from copy import deepcopy
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from maniport.bodies import Arm, EllipsoidSpec
from maniport.bodies.collisions import Collisions, as_collisions, free_postures
from maniport.bodies.manipulability import manipulability
from maniport.spd.kernels import compose, congruence, distances, eigh
from maniport.tracking.fitting import require_alike
from maniport.tracking.objective import Objective, Targets
from maniport.tracking.plan.axis import Axis
from maniport.tracking.plan.in_place import IN_PLACE, in_place, turned_about
from maniport.tracking.plan.nodes import Nodes
from maniport.validation import SPD_TOLERANCE, Array, as_count, as_generator

SAMPLES = 100_000
"""With 30 000 the planned motion of the demo's recording is 3 % farther from its targets."""
PROBES = 32
IDLE = 1e-9
"""Share of the largest effect of a joint below which another joint has none."""
CANDIDATES = 2
"""Samples looked at for each node that is wanted."""
TURNED_CANDIDATES = 8
"""The same where the tip shall be turned in some way, too: few samples next to a place are turned alike."""
FEWEST = 16
"""Where fewer have their tip in place, the nearest so many are nodes, too: the place may be out of reach."""
GAP_WEIGHT = 30.0
"""What a metre between a place and the tip of a sample counts for where samples alone tell what is possible [1/m]."""
BLOCK = 1024
"""So many targets are compared with their samples at a time: what they need stays in the processor's cache."""


class Atlas:
    """Samples of an arm, by the positions of their tip.

    Parameters
    ----------
    arm : Arm
    spec : EllipsoidSpec
        Which ellipsoids, of velocity.
    n : int, optional
        How many samples; 100 000 by default.
    random_state : None, int or numpy.random.Generator
        Same seed, same samples.
    collisions : maniport.bodies.collisions.Collisions or True, optional
        Samples that collide are left out, as in `maniport.sample_domain`; nodes that do are `Nodes.without`'s matter.

    See Also
    --------
    Planner : holds one.
    place_path : looks through it.
    """

    def __init__(
        self, arm: Arm, spec: EllipsoidSpec, n: int | None = None, random_state: Any = 0, collisions: Any = None
    ):
        self.arm, self.spec = arm, spec
        apart = as_collisions(collisions, arm)
        self.collisions: Collisions | None = apart if apart is not None and apart.known else None
        probes = arm.sample(PROBES, 0)
        jacobian, _, changes = arm.differentials(probes, spec)
        self.axis = Axis.of(jacobian, arm.forward(probes)[:, :3, 3])
        moves, shapes = np.abs(jacobian[:, :3]).max(axis=(0, 1)), np.abs(changes).max(axis=(0, 2, 3))
        self.idle = (moves <= IDLE * moves.max()) & (shapes <= IDLE * shapes.max())
        tips = arm.forward(probes)
        ways = np.abs(np.cross(jacobian[:, 3:, :, None], tips[:, :3, None, :3], axis=1)).max(axis=(0, 1))
        self._turns = self.idle[:, None] & (ways > IDLE)
        """Whether a joint that is idle else turns each axis of the tip, shape (dof, 3)."""
        generator = as_generator(random_state)
        self._drawing = SAMPLES if n is None else as_count(n, "n"), deepcopy(generator)
        arm.sample(1, generator)  # who draws next gets what comes after the samples, which are drawn when needed

    @cached_property
    def _drawn(self) -> Array:
        """The samples, shape (n, dof)."""
        count, generator = self._drawing
        return free_postures(self.arm, count, deepcopy(generator), collisions=self.collisions)

    @cached_property
    def q(self) -> Array:
        """The samples with what makes no difference in the middle, shape (n, dof)."""
        q, middle = self._drawn.copy(), 0.5 * (self.arm.lower + self.arm.upper)
        q[:, self.idle] = middle[self.idle]
        if self.axis is not None:
            q[:, 0] = middle[0]
        return q

    @cached_property
    def _made(self) -> tuple[Array, Array, Array]:
        """What the arm does there: `tips`, `moves` and `ellipsoids`."""
        jacobian = self.arm.jacobian(self.q)
        ellipsoids = manipulability(jacobian, self.arm.resolved(self.spec.velocity))
        if self.spec.kind == "force":
            values, vectors = eigh(ellipsoids)
            singular = SPD_TOLERANCE * values.sum(axis=1, keepdims=True)  # immensely far from any target
            ellipsoids = compose(1.0 / np.maximum(values, singular), vectors)
        return self.arm.forward(self.q)[:, :3, 3], jacobian[:, :3], ellipsoids

    @property
    def tips(self) -> Array:
        """Positions of the tip, shape (n, 3) [m]."""
        return self._made[0]

    @property
    def moves(self) -> Array:
        """Jacobians of the tip's position, shape (n, 3, dof)."""
        return self._made[1]

    @property
    def ellipsoids(self) -> Array:
        """Those of the spec, shape (n, d, d)."""
        return self._made[2]

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.coordinates(self.tips)[0])

    @cached_property
    def _angles(self) -> Array:
        return self.coordinates(self.tips)[1]

    @cached_property
    def _upright(self) -> Array:
        return self._turned_back(self.ellipsoids, self._angles)

    def __len__(self) -> int:
        return self._drawing[0]

    @cached_property
    def spacing(self) -> float:
        """Median distance from samples to the next, however the arm is turned [m]."""
        return float(np.median(self._tree.query(self._tree.data[:1000], k=[2])[0]))

    def require_fits(self, arm: Arm, spec: EllipsoidSpec) -> None:
        """Raise InvalidInputError unless this atlas holds the ellipsoids of `spec` that `arm` makes."""
        require_alike("the atlas was built for", (self.arm, arm), (self.spec, spec), limits=True)

    @cached_property
    def reach(self) -> Array:
        """Where the tip is at the samples, joint 1 anywhere within its limits, shape (n, 3) [m]."""
        return self._tips(np.arange(len(self.q)), self._drawn[:, 0] - self.q[:, 0])

    def ways(self, positions: Array) -> Array:
        """Ways from positions (n, 3) to the tip of the sample that is next, turned there as if nothing hindered [m]."""
        places, angles = self.coordinates(positions)
        rows = self._tree.query(places)[1]
        turns = np.zeros(len(rows)) if self.axis is None else angles - self._angles[rows]
        return self._tips(rows, turns) - positions

    def _tips(self, rows: NDArray[np.intp], turns: Array) -> Array:
        """Where the tips of samples (n,) are once the arm has turned by angles (n,), shape (n, 3) [m]."""
        if self.axis is None:
            return self.tips[rows]
        turned = self.axis.turns(turns) @ (self.tips[rows] - self.axis.origin)[..., None]
        return np.asarray(turned[..., 0] + self.axis.origin)

    def costs(self, objective: Objective, ellipsoids: Array, positions: Array, count: int) -> Array:
        """Least d² + (`GAP_WEIGHT` · gap)² of the samples next to positions (n, 3), for ellipsoids (n, d, d); (n,).

        The gap is from a position to the tip of a sample that is turned there as far as the first joint's limits allow.
        """
        places, angles = self.coordinates(positions)
        asked = objective.damped(self._turned_back(ellipsoids, angles))
        result = np.empty(len(places))
        for first in range(0, len(places), BLOCK):
            part = slice(first, first + BLOCK)
            gaps, rows = self._tree.query(places[part], k=[*range(1, min(count, len(self.q)) + 1)])
            gaps = gaps**2
            if self.axis is not None:
                turned = self._turned(rows, angles[part])
                beyond = turned - np.clip(turned, self.arm.lower[0], self.arm.upper[0])
                gaps += (2.0 * places[part, :1] * np.sin(0.5 * beyond)) ** 2
            found = distances(asked[part, None], objective.damped(self._upright[rows]))
            result[part] = np.min(found**2 + GAP_WEIGHT**2 * gaps, axis=1)
        return result

    def nodes(self, targets: Targets, count: int, random: np.random.Generator) -> Nodes:
        """At most `count` postures for each target, with the tip at its position.

        Of the samples next to that place half are those with the nearest ellipsoids, half are drawn; the tip is then
        brought to its place by Newton's method, and turned as it shall be where that counts. Where the first joint may
        turn more than once, the same postures a turn away are nodes beside these: a path may lead around the arm.
        """
        q, rows, distance = self._near(targets, (TURNED_CANDIDATES if targets.turned else CANDIDATES) * count)
        order = np.argsort(distance, axis=1, kind="stable")
        half = count // 2
        rest = random.permuted(order[:, half:], axis=1)[:, : count - half]
        chosen = np.concatenate([order[:, :half], np.sort(rest, axis=1)], axis=1)
        possible = np.isfinite(np.take_along_axis(distance, chosen, axis=1))
        q = np.take_along_axis(q, chosen[..., None], axis=1)[possible]
        rows = np.take_along_axis(rows, chosen, axis=1)[possible]
        owner = np.nonzero(possible)[0]
        if targets.turned:
            q = turned_about(targets[owner], q)
        assert targets.positions is not None
        q, away = self._in_place(q, None if targets.turned else rows, targets.positions[owner])
        kept = away <= IN_PLACE
        short = np.bincount(owner[kept], minlength=len(targets)) < FEWEST
        if short.any():
            order = np.lexsort((away, owner))
            start = np.searchsorted(owner[order], owner[order])
            nearest = order[np.arange(len(order)) - start < FEWEST]
            kept[nearest] |= short[owner[nearest]]
        q, owner = self._all_turns(q[kept], owner[kept])
        first = np.searchsorted(owner, np.arange(len(targets) + 1))
        return Nodes(q, targets[owner].cost(q), first)

    def _all_turns(self, q: Array, owner: NDArray[np.intp]) -> tuple[Array, NDArray[np.intp]]:
        """These postures (n, dof), and those a whole turn of the first joint away that its limits allow, by owner."""
        if self.axis is None:
            return q, owner
        turned = np.repeat(q[:, None], 3, axis=1)
        turned[:, :, 0] += 2.0 * np.pi * np.array([0.0, 1.0, -1.0])
        allowed = (turned[:, :, 0] >= self.arm.lower[0]) & (turned[:, :, 0] <= self.arm.upper[0])
        allowed[:, 0] = True
        return turned[allowed], np.repeat(owner, allowed.sum(axis=1))

    def _in_place(self, q: Array, rows: NDArray[np.intp] | None, positions: Array) -> tuple[Array, Array]:
        """Bring the tips of turned samples to their positions; what is known of the samples saves the first look."""
        if rows is None:
            return in_place(
                self.arm, q, positions, positions - self.arm.forward(q)[:, :3, 3], self.arm.jacobian(q)[:, :3]
            )
        tips, moves = self.tips[rows], self.moves[rows]
        if self.axis is not None:
            turns = self.axis.turns(q[:, 0] - self.q[rows, 0])
            tips = (turns @ (tips - self.axis.origin)[..., None])[..., 0] + self.axis.origin
            moves = turns @ moves
        return in_place(self.arm, q, positions, positions - tips, moves)

    def _near(self, targets: Targets, count: int) -> tuple[Array, NDArray[np.intp], Array]:
        """Samples next to each target's position: turned there (n, k, dof), their rows and distances (n, k)."""
        assert targets.positions is not None
        places, angles = self.coordinates(targets.positions)
        rows = self._tree.query(places, k=[*range(1, min(count, len(self.q)) + 1)])[1]
        q, ellipsoids = self.q[rows], self.ellipsoids[rows]
        allowed, rotations = np.ones(rows.shape, bool), np.eye(3)
        if self.axis is not None:
            lower, upper = self.arm.lower[0], self.arm.upper[0]
            turned = self._turned(rows, angles)
            allowed = (turned >= lower) & (turned <= upper)
            turned = np.clip(turned, lower, upper)
            allowed |= ~allowed.any(axis=1, keepdims=True)  # better beside the place than nothing at all
            rotations = self.axis.turns(turned - q[..., 0])
            q = np.concatenate([turned[..., None], q[..., 1:]], axis=-1)
            ellipsoids = congruence(self._for_spec(rotations), ellipsoids)
        values = eigh(congruence(targets.whitening[:, None], targets.objective.damped(ellipsoids)))[0]
        square = np.sum(np.log(np.maximum(values, np.finfo(np.float64).tiny)) ** 2, axis=-1)
        if targets.turned:
            assert targets.rotations is not None
            weights = np.array(targets.objective.axis_weights)
            needed = self._turns @ (weights > 0.0)
            q[..., needed] = self._drawn[rows][..., needed]
            away = rotations @ self._tip_axes[rows] - targets.rotations[:, None]
            square += np.sum((weights * away) ** 2, axis=(-2, -1))
        return q, rows, np.where(allowed, np.sqrt(square), np.inf)

    @cached_property
    def _tip_axes(self) -> Array:
        """How the tips of the samples are turned, idle joints as drawn, shape (n, 3, 3)."""
        return np.asarray(self.arm.forward(np.where(self.idle, self._drawn, self.q))[:, :3, :3])

    def _turned(self, rows: NDArray[np.intp], angles: Array) -> Array:
        """The first joint at samples (n, k) turned to angles (n,): of several turns that next to its limits' middle."""
        turned = angles[:, None] - self._angles[rows]
        return np.asarray(self.q[rows, 0] + np.remainder(turned + np.pi, 2.0 * np.pi) - np.pi)

    def _turned_back(self, ellipsoids: Array, angles: Array) -> Array:
        """Ellipsoids (n, d, d) as they are once the arm has turned back by angles (n,)."""
        if self.axis is None:
            return ellipsoids
        return congruence(self._for_spec(self.axis.turns(-angles)), ellipsoids)

    def coordinates(self, points: Array) -> tuple[Array, Array]:
        """Where points are for an arm that turns as a whole, (..., 2) or else (..., 3), and at which turn (...)."""
        return (points, np.zeros(points.shape[:-1])) if self.axis is None else self.axis.cylindrical(points)

    def _for_spec(self, rotations: Array) -> Array:
        """Rotations of ellipsoids (..., d, d) for those of space (..., 3, 3)."""
        d = self.spec.size
        if d == 3:
            return rotations
        both = np.zeros((*rotations.shape[:-2], d, d))
        both[..., :3, :3] = both[..., 3:, 3:] = rotations
        return both
