"""What a fitted adapter is, in words: for a prompt and for a notebook."""

from typing import TYPE_CHECKING

import numpy as np

from maniport.transfer.rotation_group import rotation_angle

if TYPE_CHECKING:
    from maniport.transfer.adapter import DomainAdapter


def is_fitted(adapter: "DomainAdapter") -> bool:
    """Whether a fit has come to its end; its last attribute tells."""
    return hasattr(adapter, "released_damping_")


def in_a_line(adapter: "DomainAdapter") -> str:
    """Tell how the fit went: rotation, scale, why it ended, and what the clouds know."""
    found = getattr(adapter, "identifiability_", None)
    return "; ".join(
        [
            f"R turns by {_degrees(adapter.rotation_)}, s = {adapter.dispersion_ratio_:.3g}",
            adapter.stop_reason_,
            *([] if found is None else [found.in_words()]),
        ]
    )


def facts(adapter: "DomainAdapter", parameters: str) -> dict[str, object]:
    """Tell how the fit went, fact by fact."""
    if not is_fitted(adapter):
        return {"parameters": parameters, "state": "not fitted yet; call fit(teacher, student)"}
    found, turn = getattr(adapter, "identifiability_", None), getattr(adapter, "turn_", None)
    in_base = "" if turn is None else f"; the map turns by {_degrees(turn)} in the student's base frame"
    state = "converged" if adapter.converged_ else "not converged"
    return {
        "parameters": parameters,
        "ellipsoids": f"{len(adapter.rotation_)} × {len(adapter.rotation_)}",
        "rotation": f"R turns recentred ellipsoids by {_degrees(adapter.rotation_)}{in_base}",
        "dispersion ratio": f"s = {adapter.dispersion_ratio_:.4g} "
        f"(teacher {adapter.teacher_dispersion_:.4g}, student {adapter.student_dispersion_:.4g})",
        "regularisation": _regularization(adapter),
        "identifiability": None if found is None else f"{found.in_words()}{_spread(found.spread_deg)}",
        "cost": f"{adapter.cost_:.4g}",
        "ended": f"{adapter.stop_reason_} ({adapter.n_iter_} iterations, {state})",
    }


def _regularization(adapter: "DomainAdapter") -> str:
    if adapter.floor is not None:
        return f"eigenvalues below {adapter.floor:g} lifted"
    if adapter.teacher_damping_ == 0.0:
        return "none"
    return f"damping of {adapter.teacher_damping_:.3g} for the teacher, {adapter.student_damping_:.3g} for the student"


def _spread(degrees: float) -> str:
    return "" if np.isnan(degrees) else f"; resampled clouds spread it by {degrees:.2g}°"


def _degrees(rotation: np.typing.NDArray[np.float64]) -> str:
    return f"{np.degrees(rotation_angle(np.eye(len(rotation)), rotation)):.1f}°"
