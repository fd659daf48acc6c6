"""The length field: rescale eigenvalues toward the student's feasible set and keep the teacher's axes."""

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from maniport.errors import InvalidInputError, NotInvertibleError
from maniport.spd.kernels import compose
from maniport.spd.matrix_functions import to_vector
from maniport.spd.regularization import Regularization
from maniport.transfer.adapter import DomainAdapter
from maniport.transfer.adapter_file import POSITIVE, Attribute, Schema
from maniport.transfer.length_field.field import MAX_NEAR_SINGULAR, LengthsMap, as_axis, inverse
from maniport.transfer.length_field.fit import (
    TIE,
    FieldReport,
    NearestSamples,
    Projector,
    Samples,
    centers_among,
    fitted,
    reported,
)
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_count, as_finite, as_flag, as_number

HELD_OUT = 400  # Most samples that are held out of the fit


def _as_unit_vector_or_empty(value: ArrayLike, name: str) -> None:
    if np.size(value) and (
        np.size(value) != 3 or abs(np.linalg.norm(as_finite(value, name)) - 1.0) > 1e-9
    ):
        raise InvalidInputError(f"{name} must be a unit vector or empty")


class LengthField(DomainAdapter):
    """Keep every axis and rescale its length toward the feasible ellipsoids; equations (36) to (40).

    One smooth scalar function gives the change of an axis's logarithmic length from the ellipsoid and that length. In
    each iteration of the fit, the projector finds the feasible ellipsoids nearest to the images, and a weighted ridge
    regression moves the lengths toward them. The results are SPD for every input; far from the samples the map is
    k Tˢ. Where it folds it has no inverse: `inverse_transform` refuses images there, and all images of a map that folds
    at too many of its centers.

    Parameters
    ----------
    damping, base_rotation
        As in `ParallelTransport`; the default damping is that of the projector, if it has one.
    projector : callable, optional
        Finds the nearest feasible ellipsoids: `maniport.FeasibleProjector` of an arm, or any
        `maniport.transfer.length_field.fit.Projector`. Default: the student's samples; images are then at least as far
        away as neighboring samples. It is not saved with the adapter.
    n_samples : int
        Most of the teacher's samples to fit to, evenly spread over its domain.
    n_centers : int, optional
        Number of centers, the farthest among the samples. Default: 300, or all of fewer samples.
    width : float
        Kernel width w by the student's dispersion.
    ridge : float
        Penalty of the field's own norm; more makes it smoother and leaves it farther from the nearest ellipsoids.
    n_rounds : int

    Attributes
    ----------
    cost_ : float
        Mean distance from the samples' images to the nearest feasible ellipsoids.
    report_ : FieldReport
        The same, and the map's smoothness, at held-out samples; see `maniport.transfer.length_field.fit`.
    from_samples_ : bool
        Whether there was no projector.
    width_, centers_, lengths_ : float; ndarrays, shapes (m, D), D = d (d + 1) / 2, and (m, 3)
        w, centers c_j and coefficients a_jr.
    axis_ : ndarray, shape (3,) or (0,)
        Axis of symmetry of the feasible set, a unit vector in the student's frame; empty where there is none.
    rotation_, dispersion_ratio_
        The identity, and s.
    """

    schema: ClassVar[Schema] = DomainAdapter.schema | {
        "width_": Attribute((), POSITIVE),
        "centers_": Attribute(("m", "D"), as_finite),
        "lengths_": Attribute(("m", 3), as_finite),
        "axis_": Attribute(("axis",), _as_unit_vector_or_empty),
        "from_samples_": Attribute((), as_flag),
    }

    def __init__(
        self,
        damping: float | None = None,
        base_rotation: ArrayLike | None = None,
        projector: Projector | None = None,
        n_samples: int = 2048,
        n_centers: int | None = None,
        width: float = 0.8,
        ridge: float = 2e-4,
        n_rounds: int = 6,
    ):
        super().__init__(damping, base_rotation)
        self.projector = projector
        self.n_samples = n_samples
        self.n_centers = n_centers
        self.width = width
        self.ridge = ridge
        self.n_rounds = n_rounds

    _lengths_map: LengthsMap

    def _fit(self, teacher: Array, student: Array) -> None:
        with threadpool_limits(limits=1):  # more threads take longer
            self._fit_lengths(teacher, student)

    def _fit_lengths(self, teacher: Array, student: Array) -> None:
        most = as_count(self.n_samples, "n_samples", minimum=2)
        width = as_number(self.width, "width", above=0.0)
        ridge = as_number(self.ridge, "ridge", above=0.0)
        rounds = as_count(self.n_rounds, "n_rounds")
        self._describe(teacher, student)
        for name, domain in (("teacher", teacher), ("student", student)):
            if len(domain) <= domain.shape[-1]:
                raise InvalidInputError(
                    f"{name} must hold more than {domain.shape[-1]} ellipsoids of this size for a field of lengths; "
                    f"found {len(domain)}"
                )
        self.dispersion_ratio_ = self.student_dispersion_ / self.teacher_dispersion_
        self.axis_ = as_axis(
            getattr(self.projector, "axis", None), "projector.axis", teacher.shape[-1]
        )
        damping = float(self.student_damping_)
        if getattr(self.projector, "needs_damping", False) and damping == 0.0:
            raise InvalidInputError(
                f"LengthField needs damping with the projector {self.projector!r}"
            )
        projector: Projector = NearestSamples(student)
        if self.projector is not None:
            projector = self.projector
        if not callable(projector) and not hasattr(projector, "search"):
            text = "projector must be callable, such as maniport.FeasibleProjector(arm)"
            raise InvalidInputError(f"{text}; found {projector!r}")
        self.width_ = width * self.student_dispersion_
        self.centers_ = np.zeros((0, 1))
        self.lengths_ = np.zeros((0, 3))
        seen, held_out = _split(self._field(), teacher, most)
        samples = Samples(self._field(), seen, projector, damping)
        if self.n_centers is None:
            count = min(300, len(seen))
        else:
            count = as_count(self.n_centers, "n_centers", 1, len(seen))
        self.centers_ = samples.x[centers_among(samples.x, count)]
        self.lengths_ = np.zeros((len(self.centers_), 3))
        field, history = fitted(self._field(), samples, ridge, rounds)
        self.lengths_ = field.lengths
        self.history_ = np.array(history)
        self.cost_ = history[-1]
        self.converged_ = True
        self.n_iter_ = rounds
        self.from_samples_ = self.projector is None
        self.stop_reason_ = f"{rounds} rounds toward the {'nearest samples' if self.from_samples_ else 'feasible set'}"
        if len(held_out):
            points = held_out
        else:
            points = seen[:HELD_OUT]
        self.report_ = reported(field, Samples(field, points, projector, damping), len(held_out))

    def failures(self) -> tuple[str, ...]:
        """Return the checks that the map fails at held-out samples; see `FieldReport`."""
        return self.report_.failures()

    def _unfitted_damping(self) -> Regularization:
        if self.damping is None:
            return Regularization(getattr(self.projector, "damping", None))
        return super()._unfitted_damping()

    def _settle(self) -> None:
        report = getattr(self, "report_", {})
        if not isinstance(report, FieldReport):  # it was read from a file
            self.report_ = FieldReport(**report)
            self.report_.in_words()  # raises where a value is no number
        self._lengths_map = self._field()

    def _field(self) -> LengthsMap:
        """Return the fitted map."""
        d = len(self.teacher_mean_)
        s = float(self.dispersion_ratio_)
        teacher = float(np.linalg.slogdet(self.teacher_mean_)[1]) / d
        student = float(np.linalg.slogdet(self.student_mean_)[1]) / d
        # log k makes the determinants of the means agree; less ℓ̄ it is −s log det(T̄) / d
        return LengthsMap(
            s, -s * teacher, student, float(self.width_), self.centers_, self.lengths_, self.axis_
        )

    def _map(self, points: Array) -> Array:
        return self._lengths_map.apply(points)

    def _map_back(self, points: Array) -> Array:
        field = self._lengths_map
        folded = field.folded_centers
        if folded > MAX_NEAR_SINGULAR:
            raise NotInvertibleError(
                f"the map has no inverse: its derivative is nearly singular at {100 * folded:.0f} % of centers (limit "
                f"{100 * MAX_NEAR_SINGULAR:.0f} %)"
            )
        back = inverse(field, points)
        lost = np.flatnonzero(np.isnan(back[:, 0, 0]))
        if len(lost):
            raise NotInvertibleError(
                f"points[{lost[0]}] lies where the map folds or nearly so, or is no image of an ellipsoid of the "
                f"teacher; so do {len(lost)} of {len(points)}"
            )
        return back


def _split(base: LengthsMap, teacher: Array, most: int) -> tuple[Array, Array]:
    """Split ellipsoids (n, d, d) into at most `most` to fit to, and a held-out eighth; the same in any order."""
    values, vectors = base.base(teacher)
    keys = np.column_stack([values.sum(axis=1), values, to_vector(compose(values, vectors))])
    # the axes decide between samples of equal eigenvalues
    order = np.lexsort(np.round(keys / TIE).T[::-1])
    count = min(HELD_OUT, len(order) // 8)
    if count >= 16:
        apart = evenly_spaced(len(order), count)
    else:
        apart = evenly_spaced(0, 0)
    others = np.delete(order, apart)
    return teacher[others[evenly_spaced(len(others), most)]], teacher[order[apart]]
