"""Baselines of the comparison, which are adapters themselves."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.evaluation.metrics import as_pair
from maniport.spd.kernels import symmetrize
from maniport.transfer import METHODS, DomainAdapter, method_of
from maniport.transfer.rigid_adapter import RigidAdapter, recenter
from maniport.util.optional import how_to_install, pyriemann_transfer
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array, as_choice

IDENTITY, MEAN_TRANSPORT, TRANSPORT, LOOKUP = "identity", "mean-transport", "parallel-transport", "nearest-neighbor"
PROCRUSTES = "procrustes"  # Baselines by their names in `maniport.transfer.METHODS`, but for `Procrustes`

ROWS = (IDENTITY, MEAN_TRANSPORT, TRANSPORT, LOOKUP, PROCRUSTES)  # The default baselines, cheapest first

EVERY_ROW = (*METHODS, PROCRUSTES)  # All baselines


class Procrustes(RigidAdapter):
    """Riemannian Procrustes analysis by pyRiemann: TLCenter, TLScale and, where there are pairs, TLRotate."""

    dispersion, recenter, scale = "rms", "training", True

    def __init__(
        self,
        damping: float | None = None,
        eigenvalue_floor: float | None = None,
        base_rotation: ArrayLike | None = None,
        pairs: Any = None,
    ):
        super().__init__(damping, eigenvalue_floor, base_rotation)
        self.pairs = pairs

    def _fit(self, teacher: Array, student: Array) -> None:
        pyriemann = pyriemann_transfer()
        clouds, labels = _labelled(teacher, student)
        center = pyriemann.TLCenter("student")
        centered = center.fit_transform(clouds, labels)
        squared = pyriemann.TLScale("student", centered_data=True).fit(centered, labels).scales_
        inverse_roots = [center.centers_[name].inv_filters_ for name in ("teacher", "student")]
        self.teacher_mean_, self.student_mean_ = (symmetrize(root @ root) for root in inverse_roots)
        self.teacher_dispersion_, self.student_dispersion_ = (
            float(np.sqrt(squared[name])) for name in ("teacher", "student")
        )
        self.dispersion_ratio_ = self.student_dispersion_ / self.teacher_dispersion_
        self.rotation_ = np.eye(teacher.shape[-1])
        self._fit_rotation(teacher, student)
        self._settle()

    def _fit_rotation(self, teacher: Array, student: Array, max_pairs: int = 500) -> None:
        """Fit TLRotate to at most so many pairs, each of which is a class."""
        self._set_closed_form("closed form, without TLRotate: no pairs")
        if self.pairs is None:
            return
        first, other = self.teacher_side(self.pairs[0], "pairs[0]"), self.student_side(self.pairs[1], "pairs[1]")
        first, other = as_pair(first, other, "pairs[0]", "pairs[1]", minimum=2)
        chosen = evenly_spaced(len(first), max_pairs)
        moved = recenter(first[chosen], self.teacher_mean_, self.dispersion_ratio_)
        classes = [f"{i:06d}" for i in range(len(chosen))]
        clouds, labels = _labelled(moved, recenter(other[chosen], self.student_mean_), classes)
        rotation = pyriemann_transfer().TLRotate("student").fit(clouds, labels).rotations_["teacher"]
        # a reflection −R does what R does where d is odd
        self.rotation_ = -rotation if np.linalg.det(rotation) < 0 and len(rotation) % 2 else rotation
        self.stop_reason_ = f"TLRotate on {len(chosen)} pairs"


def _labelled(teacher: Array, student: Array, classes: Sequence[str] | None = None) -> Any:
    """Join two clouds, and label their samples domain/class as pyRiemann does; one class for all by default."""
    clouds = {"teacher": teacher, "student": student}
    labels = [f"{name}/{label}" for name, cloud in clouds.items() for label in classes or ["all"] * len(cloud)]
    return np.concatenate([teacher, student]), np.array(labels)


@dataclass(frozen=True)
class Baseline:
    """A baseline to compare with; `note` is why there is no adapter, or a remark on it."""

    name: str
    adapter: DomainAdapter | None
    note: str = ""
    fitted: bool = False


def baselines_for(
    adapter: DomainAdapter,
    name: str,
    rows: Sequence[str] = ROWS,
    pairs: Any = None,
    fitted: Mapping[str, DomainAdapter] | None = None,
) -> list[Baseline]:
    """List baselines with the adapter's regularization and base_rotation, without the adapter's own method."""
    parameters, ready = adapter.get_params(deep=False), fitted or {}
    shared = {key: parameters.get(key) for key in ("damping", "eigenvalue_floor", "base_rotation")}
    for row in rows:
        as_row(row, "row")
    baselines = []
    for row in dict.fromkeys((*rows, *ready)):
        if row in ready:
            _require_alike(ready[row], adapter, row)
            baseline = Baseline(row, ready[row], _note(row, pairs), fitted=True)
        elif row != PROCRUSTES:
            baseline = Baseline(row, method_of(row, **shared), _note(row, pairs))
        elif find_spec("pyriemann") is not None:
            baseline = Baseline(row, Procrustes(**shared, pairs=pairs), _note(row, pairs))
        else:
            baseline = Baseline(row, None, f"pyriemann is not installed ({how_to_install('compare')})")
        if isinstance(baseline.adapter, type(adapter)):
            continue
        if row == name:
            raise InvalidInputError(f"name must not be that of a baseline; found {name!r}")
        baselines.append(baseline)
    return baselines


def as_row(name: Any, argument: str, *also: str) -> str:
    """Require one of `EVERY_ROW` or of the further names."""
    return as_choice(name, argument, (*EVERY_ROW, *also))


def _note(row: str, pairs: Any) -> str:
    if row == PROCRUSTES:
        return "TLCenter and TLScale only: TLRotate needs pairs" if pairs is None else "TLCenter, TLScale, TLRotate"
    return "returns samples of the student only: its gap is zero" if row == LOOKUP else ""


def _require_alike(fitted: DomainAdapter, adapter: DomainAdapter, row: str) -> None:
    """Raise unless a fitted baseline has the adapter's regularization and base_rotation."""
    alike = fitted.student_regularization == adapter.student_regularization
    alike &= fitted.teacher_regularization == adapter.teacher_regularization
    own, other = (np.eye(1) if each.base_rotation_ is None else each.base_rotation_ for each in (fitted, adapter))
    if not alike or not np.array_equal(own, other):
        raise InvalidInputError(f"fitted[{row!r}] must have the adapter's regularization and base_rotation")
