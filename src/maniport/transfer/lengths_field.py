"""Changing lengths only: a smooth field that asks for what the student can make, with the teacher's axes."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError, NotInvertibleError
from maniport.spd.regularization import Regularization
from maniport.transfer.adapter import DomainAdapter
from maniport.transfer.lengths.field import KAPPA, LengthsMap, damped
from maniport.transfer.lengths.inverse import MOST_FOLDED, Inverse
from maniport.transfer.lengths.plan import FitPlan
from maniport.transfer.lengths.projector import NearestSamples, as_projector
from maniport.transfer.lengths.symmetry import NO_AXIS, as_axis
from maniport.validation import Array, as_count, as_flag, as_number, as_positive_semidefinite

if TYPE_CHECKING:
    from maniport.transfer.control import CompiledMap


class LengthsField(DomainAdapter):
    """Keep every axis, and lengthen each by as much as takes the ellipsoid to what the student can make.

    A rigid map leaves its images beside what the student can make, by 0.2 to 0.5 on average. Ellipsoids with the same
    axes and other lengths come near it: one smooth scalar function says how much to lengthen an axis, given the
    ellipsoid and that axis's length. With the teacher's ellipsoids T in the student's frame and damped,

        f(T) = exp(L + h(x, L)),   L = log(k Tˢ) − ℓ̄ I,   x = vec L,   ℓ̄ added back at the end,

    where s makes the dispersions equal and k the volumes of the means, ℓ̄ is the mean logarithm of the student's mean,
    and h(x, ℓ) = Σ_r tanh(ℓ/2)^r Σ_j exp(−|φ(x) − φ(c_j)|² / 2w²) a_jr, r = 0, 1, 2, with centres c_j among the
    samples. φ(x) = x, or where the student's first joint goes round what no turn about its axis changes of x, see
    `maniport.transfer.lengths.symmetry`: such a turn of an ellipsoid then only turns its image. Axes are kept exactly,
    also where two lengths are equal the map is smooth, its results are SPD whatever comes in, and far from the samples
    it is k Tˢ. Turning both bodies alike turns the map, and another unit of either only scales it; under other
    congruences it is another map.

    The coefficients come in rounds: the projector tells the nearest ellipsoids to the images of the samples, a weighted
    ridge regression moves the lengths toward them, and so on. What is left of the error along the ways that the
    student can move by itself counts little, where the projector tells these ways. With `turn` further rounds move what
    is left of it by a plain kernel field of symmetric matrices, for which turning the longest axis costs extra.

    Where the map folds it has no inverse. `inverse_transform` refuses images that are found to come from several
    ellipsoids, and all images of a map that folds at too many of its centers; see `maniport.transfer.lengths.inverse`.

    Parameters
    ----------
    damping, floor, mounting
        As in `ParallelTransport`; without damping and floor, the damping of the projector, if it has one. The damping
        comes off eigenvalue by eigenvalue, so that whatever the map is results are SPD: an eigenvalue y is what
        `y (y + ε) / (y + κ ε)` damps, ε the student's and κ = 1e-4.
    projector : callable, optional
        What tells the nearest ellipsoids that the student can make: `maniport.FeasibleProjector` of its arm, or any
        function of ellipsoids with the student's damping, shape (n, d, d), that returns the nearest ones, damped alike.
        See `maniport.transfer.lengths.projector` for what else it may tell, such as an axis of symmetry. Default: the
        student's samples; images then come near these and no nearer than they lie to one another. It is not saved with
        the adapter.
    turn : bool
        Whether to add a small field that may also turn axes: by about 2° where lengths alone leave a gap of 0.1, hardly
        where they leave less than 0.03. Default: axes are kept.
    n_samples : int
        Most of the teacher's samples to fit to, evenly spread over its domain; turns are fitted to as many more.
    n_centers : int, optional
        Number of centres, the farthest among the samples. Default: 300, or all of fewer samples.
    width : float
        w by the student's dispersion.
    ridge : float
        Penalty of the field's own norm; more makes it smoother and leaves it farther from the nearest ellipsoids.
    n_rounds : int
    halves : bool
        Whether to report how far two fits, each to one half of the samples, lie apart. It doubles the time.

    Attributes
    ----------
    cost_ : float
        Mean distance from the samples' images to the nearest ellipsoids, those of the projector.
    report_ : FieldReport
        How far images of samples that were set apart are from what the student can make, and what else the field does
        to them; see `maniport.transfer.lengths.report`.
    from_samples_ : bool
        Whether there was no projector.
    width_ : float
        w.
    centers_ : ndarray, shape (m, D)
        c_j, D = d (d + 1) / 2.
    lengths_ : ndarray, shape (m, 3)
        a_jr.
    turns_ : ndarray, shape (m', D) or (0, D)
        Coefficients of the field that turns, of the first m' centres.
    axis_ : ndarray, shape (3,) or (0,)
        About which what the student can make may be turned, a unit vector in its frame; empty where there is none.
    released_damping_ : float
        (1 − √κ) ε, what is taken off an eigenvalue of ε, and from larger ones up to (1 − κ) ε.
    rotation_, dispersion_ratio_
        The identity, and s.

    See Also
    --------
    DomainAdapter : the other fitted attributes.
    """

    axis_: Array = NO_AXIS  # of a file that tells none

    def __init__(
        self,
        damping: float | None = None,
        floor: float | None = None,
        mounting: ArrayLike | None = None,
        projector: Any = None,
        turn: bool = False,
        n_samples: int = 2048,
        n_centers: int | None = None,
        width: float = 0.8,
        ridge: float = 2e-4,
        n_rounds: int = 6,
        halves: bool = False,
    ):
        super().__init__(damping, floor, mounting)
        self.projector = projector
        self.turn = turn
        self.n_samples = n_samples
        self.n_centers = n_centers
        self.width = width
        self.ridge = ridge
        self.n_rounds = n_rounds
        self.halves = halves

    def _fit(self, teacher: Array, student: Array) -> None:
        most, width = as_count(self.n_samples, "n_samples", minimum=2), as_number(self.width, "width", above=0.0)
        halves = as_flag(self.halves, "halves")
        self._describe(teacher, student)
        for name, domain in (("teacher", teacher), ("student", student)):
            if len(domain) <= domain.shape[-1]:
                raise InvalidInputError(
                    f"{name} must hold more than {domain.shape[-1]} ellipsoids of this size for a field of lengths; "
                    f"found {len(domain)}"
                )
        self.dispersion_ratio_ = self.student_dispersion_ / self.teacher_dispersion_
        self.axis_ = as_axis(getattr(self.projector, "axis", None), "projector.axis", teacher.shape[-1])
        damping = float(self.student_damping_ or self.floor or 0.0)
        if getattr(self.projector, "needs_damping", False) and damping == 0.0:
            raise InvalidInputError(f"LengthsField needs damping or floor with the projector {self.projector!r}")
        plan = FitPlan(
            self._base_map(width * self.student_dispersion_),
            NearestSamples(student) if self.projector is None else as_projector(self.projector),
            damping,
            None if self.n_centers is None else as_count(self.n_centers, "n_centers"),
            as_number(self.ridge, "ridge", above=0.0),
            as_count(self.n_rounds, "n_rounds"),
            as_flag(self.turn, "turn"),
        )
        seen, more, apart = plan.divided(teacher, most)
        field, history = plan.fitted(seen, more)
        self.history_, self.cost_ = np.array(history), history[-1]
        self.converged_, self.n_iter_, self.from_samples_ = True, len(history) - 1, self.projector is None
        asked = "the nearest samples" if self.projector is None else "what the student can make"
        self.stop_reason_ = f"{plan.rounds} rounds toward {asked}{', then turned' if plan.turn else ''}"
        self.width_, self.centers_, self.lengths_, self.turns_ = field.width, field.centers, field.lengths, field.turns
        if not self._silent:
            self.report_ = plan.reported(field, seen, more, apart, halves)
        self.released_damping_ = (1.0 - np.sqrt(KAPPA)) * self.student_damping_

    def _regularization(self, epsilon: float = 0.0) -> Regularization:
        own = super()._regularization(epsilon)
        if own == Regularization():
            return Regularization(getattr(self.projector, "damping", None))
        return own

    def _base_map(self, width: float) -> LengthsMap:
        """Return the map without a field."""
        d = len(self.teacher_mean_)
        middles = [float(np.linalg.slogdet(mean)[1]) / d for mean in (self.teacher_mean_, self.student_mean_)]
        s, size = float(self.dispersion_ratio_), d * (d + 1) // 2
        # log k makes the determinants of the means agree; less ℓ̄ it is −s log det(T̄) / d
        return LengthsMap(
            s,
            -s * middles[0],
            middles[1],
            width,
            np.zeros((0, size)),
            np.zeros((0, 3)),
            np.zeros((0, size)),
            self.axis_,
        )

    def _field(self) -> LengthsMap:
        """Return the fitted map."""
        plain = self._base_map(float(self.width_))
        return replace(plain, centers=self.centers_, lengths=self.lengths_, turns=self.turns_)

    def _map(self, points: Array) -> tuple[Array, float]:
        return self._field().apply(points), self.released_damping_

    def _images(self, points: Array) -> Array:
        return self._field().apply(points, self._released_epsilon())

    def _released_epsilon(self) -> float | None:
        return float(self.student_damping_) or None

    def _damped_again(self, points: ArrayLike) -> Array:
        epsilon = self._released_epsilon()
        if epsilon is None:
            return super()._damped_again(points)
        return damped(as_positive_semidefinite(points, "points", self._dimension()), epsilon)

    def _map_back(self, points: Array) -> Array:
        inverse = Inverse.of(self._field())
        if inverse.folded > MOST_FOLDED:
            raise NotInvertibleError(
                f"the map folds at {inverse.folded:.0%} of its centers, more than {MOST_FOLDED:.0%}: too many of its "
                "images come from several ellipsoids of the teacher for an inverse"
            )
        back = inverse(points)
        lost = np.flatnonzero(np.isnan(back[:, 0, 0]))
        if len(lost):
            raise NotInvertibleError(
                f"points[{lost[0]}] lies where the map folds or nearly so, and is the image of no single ellipsoid of "
                f"the teacher; {len(lost)} of {len(points)} do"
            )
        return back

    def singular_values(self, points: ArrayLike) -> Array:
        """How the map squeezes the space around ellipsoids of the teacher, shape (..., d, d): where it folds.

        Returns
        -------
        ndarray, shape (...)
            Smallest singular value of the derivative of the image's logarithm by that of k Tˢ: 1 where lengths are
            moved by equal amounts or not at all, near 0 where the map folds and has no inverse, negative where it has
            folded and turned what is left into right.

        Raises
        ------
        NotFittedError, NotSPDError, InvalidInputError
            As `transform`.
        """
        d = self._dimension()
        seen = self.teacher_side(points, "points")
        return self._field().singular_values(seen.reshape(-1, d, d)).reshape(seen.shape[:-2])

    def novelty(self, points: ArrayLike) -> Array:
        """How far ellipsoids of the teacher, shape (..., d, d), are from the samples, as the field sees it.

        Returns
        -------
        ndarray, shape (...)
            0 at a centre, near 1 where no sample is near and the map is k Tˢ: the variance of a Gaussian process with
            the field's kernel, given the centres, over that without them. It tells where the field knows nothing, not
            how large the feasibility gap is: where the field knows enough it says nothing of that.

        Raises
        ------
        NotFittedError, NotSPDError, InvalidInputError
            As `transform`.
        """
        d = self._dimension()
        seen = self.teacher_side(points, "points")
        return self._field().novelty(seen.reshape(-1, d, d)).reshape(seen.shape[:-2])

    def compiled(self) -> "CompiledMap":
        """Return the map as a callable for one ellipsoid at a time, for control loops.

        It gives what `transform` gives, to the bit, with a floor up to rounding. It takes about two microseconds for
        d = 3 and allocates nothing when it is given `out`. Take it once, after `fit`; a later `fit` does not change it.
        """
        d = self._dimension()
        from maniport.transfer.control import compiled_map  # compiled when it is first wanted
        from maniport.transfer.lengths.one import map_one, terms_of_one

        release = np.array([self._released_epsilon() or -1.0, KAPPA])
        floor, added = float(self.floor or 0.0), float(self.teacher_damping_)
        return compiled_map(map_one, d, terms_of_one(self.mounting_, added, floor, self._field().terms(), release))
