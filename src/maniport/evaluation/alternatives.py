"""The cheap alternatives that every adapter has to beat.

Each is an adapter itself, so that everything that can be measured of one can be measured of the other.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.evaluation.measures import as_pair
from maniport.evaluation.rows import LOOKUP, RAW_COPY, RECENTRING, TRANSPORT
from maniport.optional import how_to_install, pyriemann_transfer
from maniport.spd.kernels import symmetrize
from maniport.thinning import evenly
from maniport.transfer import METHODS, DomainAdapter, method_of
from maniport.transfer.rigid_adapter import RigidAdapter, recentre
from maniport.validation import Array, as_choice

TEACHER, STUDENT = "teacher", "student"

MOST_PAIRS = 500
"""Pairs that pyRiemann gets, evenly over their order; every pair is a class of its own there."""


class Procrustes(RigidAdapter):
    """Riemannian Procrustes analysis by pyRiemann: TLCenter, TLScale and, where there are pairs, TLRotate.

    Rodrigues, Jutten & Congedo, Riemannian Procrustes Analysis, IEEE TBME 66, 2019. It moves both domains to the
    identity; here the student's mean is put back. TLRotate matches class means: each known pair is a class. Without
    pairs there are no labels, hence no rotation but the known mounting.

    Parameters
    ----------
    damping, floor, mounting
        As in `ParallelTransport`.
    pairs : tuple of array_like, shapes (k, d, d) and (k, d, d), optional
        The teacher's ellipsoids and the student's that belong to them.
    """

    dispersion, recenter, scale = "rms", "training", True

    def __init__(
        self,
        damping: float | None = None,
        floor: float | None = None,
        mounting: ArrayLike | None = None,
        pairs: Any = None,
    ):
        super().__init__(damping, floor, mounting)
        self.pairs = pairs

    def _fit(self, teacher: Array, student: Array) -> None:
        pyriemann = pyriemann_transfer()
        clouds, labels = _labelled(teacher, student, ["all"], ["all"])
        center = pyriemann.TLCenter(STUDENT)
        centered = center.fit_transform(clouds, labels)
        scales = pyriemann.TLScale(STUDENT, centered_data=True).fit(centered, labels).scales_  # mean squared distances
        means = [center.centers_[name].inv_filters_ @ center.centers_[name].inv_filters_ for name in (TEACHER, STUDENT)]
        self.teacher_mean_, self.student_mean_ = (symmetrize(one) for one in means)
        self.teacher_dispersion_, self.student_dispersion_ = (float(np.sqrt(scales[n])) for n in (TEACHER, STUDENT))
        self.dispersion_ratio_ = self.student_dispersion_ / self.teacher_dispersion_
        self.rotation_ = np.eye(teacher.shape[-1])
        self._fit_rotation(teacher, student)
        self._settle()

    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        self._found_at_once("closed form, without TLRotate: no pairs")
        if self.pairs is None:
            return
        first, other = self.teacher_side(self.pairs[0], "pairs[0]"), self.student_side(self.pairs[1], "pairs[1]")
        first, other = as_pair(first, other, "pairs[0]", "pairs[1]", minimum=2)
        chosen = evenly(len(first), MOST_PAIRS)
        moved = recentre(first[chosen], self.teacher_mean_, self.dispersion_ratio_)
        classes = [f"{i:06d}" for i in range(len(chosen))]
        clouds, labels = _labelled(moved, recentre(other[chosen], self.student_mean_), classes, classes)
        found = pyriemann_transfer().TLRotate(STUDENT).fit(clouds, labels).rotations_[TEACHER]
        # a reflection −R does what R does where d is odd
        self.rotation_ = -found if np.linalg.det(found) < 0 and len(found) % 2 else found
        self.stop_reason_ = f"TLRotate on {len(chosen)} pairs"


def _labelled(teacher: Array, student: Array, teacher_classes: list[str], student_classes: list[str]) -> Any:
    """Join two clouds and label them as pyRiemann wants, domain/class; a single class holds for a whole cloud."""
    labels = [
        f"{name}/{classes[i if len(classes) > 1 else 0]}"
        for name, cloud, classes in ((TEACHER, teacher, teacher_classes), (STUDENT, student, student_classes))
        for i in range(len(cloud))
    ]
    return np.concatenate([teacher, student]), np.array(labels)


PROCRUSTES = "procrustes"
"""Row of `Procrustes`, which is no method of `maniport.transfer.METHODS`."""

ROWS = (RAW_COPY, RECENTRING, TRANSPORT, LOOKUP, PROCRUSTES)
"""The cheap alternatives, the cheapest first."""

EVERY_ROW = (*METHODS, PROCRUSTES)
"""All that may stand beside an adapter."""


def as_row(name: Any, what: str, *also: str) -> str:
    """Require one of `EVERY_ROW` or of what else is allowed; `what` it is called in the message."""
    return as_choice(name, what, (*EVERY_ROW, *also))


@dataclass(frozen=True)
class Alternative:
    """One row of the comparison.

    Attributes
    ----------
    name : str
    adapter : DomainAdapter or None
        None where it cannot be had.
    note : str
        Why it cannot, or what to know about it.
    fitted : bool
        Whether it is fitted to the domains already.
    """

    name: str
    adapter: DomainAdapter | None
    note: str = ""
    fitted: bool = False


def others_than(
    adapter: DomainAdapter,
    name: str,
    rows: Sequence[str] = ROWS,
    pairs: Any = None,
    fitted: Mapping[str, DomainAdapter] | None = None,
) -> list[Alternative]:
    """List alternatives with the adapter's regularisation and mounting, without the method that it is itself."""
    known, ready = adapter.get_params(deep=False), fitted or {}
    shared = {key: known.get(key) for key in ("damping", "floor", "mounting")}
    for row in rows:
        as_row(row, "row")
    found = []
    for row in (*rows, *(one for one in ready if one not in rows)):
        if row in ready:
            _require_alike(ready[row], adapter, row)
            other = Alternative(row, ready[row], _note(row, pairs), fitted=True)
        else:
            other = _unfitted(row, shared, pairs)
        if isinstance(other.adapter, type(adapter)):
            continue
        if row == name:
            raise InvalidInputError(f"name must not be that of an alternative; found {name!r}")
        found.append(other)
    return found


def _unfitted(row: str, shared: dict[str, Any], pairs: Any) -> Alternative:
    if row != PROCRUSTES:
        return Alternative(row, method_of(row, **shared), _note(row, pairs))
    if find_spec("pyriemann") is None:
        return Alternative(row, None, f"pyriemann is not installed ({how_to_install('compare')})")
    return Alternative(row, Procrustes(**shared, pairs=pairs), _note(row, pairs))


def _note(row: str, pairs: Any) -> str:
    if row == PROCRUSTES:
        return "TLCenter and TLScale only: TLRotate needs pairs" if pairs is None else "TLCenter, TLScale, TLRotate"
    return "makes samples of the student only: its gap is none" if row == LOOKUP else ""


def _require_alike(one: DomainAdapter, adapter: DomainAdapter, row: str) -> None:
    """Raise unless one of the fitted alternatives treats ellipsoids as the adapter does."""
    same = one.student_regularization == adapter.student_regularization
    same &= one.teacher_regularization == adapter.teacher_regularization
    turn, other = (np.eye(1) if each.mounting_ is None else each.mounting_ for each in (one, adapter))
    if not same or not np.array_equal(turn, other):
        raise InvalidInputError(f"fitted[{row!r}] must have the adapter's regularisation and mounting")
