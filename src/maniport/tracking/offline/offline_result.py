"""What became of a motion that was optimized as a whole."""

from dataclasses import dataclass, field, fields
from itertools import pairwise
from typing import Any

import numpy as np

from maniport.tracking.follow.track_result import TrackResult
from maniport.tracking.offline.trajectory_program import Program, Solution
from maniport.validation import Array

ON_PATH = 1e-4
"""How far beyond the tolerance the hand may be beside the path and still count as on it [m]."""
KEPT = 1e-6
"""How far beyond a limit counts as kept."""


@dataclass(frozen=True, repr=False)
class OfflineResult(TrackResult):
    """A `TrackResult` with how the solver ended.

    Attributes
    ----------
    solver_status : str
        How IPOPT ended, in words.
    converged : bool
    iterations : int
    offset : ndarray, shape (3,)
        What was added to the wanted hand positions [m]; `path` includes it. Zero unless it was free.
    violations : dict of str to float
        What does not hold, by how much at most: ``"path"`` [m], ``"joint limit"``, ``"velocity limit"`` and
        ``"acceleration limit"`` [rad or m, each second, each second squared]; empty where all holds.
    """

    solver_status: str = ""
    converged: bool = False
    iterations: int = 0
    offset: Array = field(default_factory=lambda: np.zeros(3))
    violations: dict[str, float] = field(default_factory=dict)

    def _facts(self) -> dict[str, object]:
        return super()._facts() | {
            "solver": f"{self.solver_status} after {self.iterations} iterations",
            "path shifted by": "" if not np.any(self.offset) else f"{_millimetres(self.offset)} mm",
            "does not hold": ", ".join(f"{name}, by {amount:.3g} at most" for name, amount in self.violations.items()),
        }

    def summary(self) -> dict[str, Any]:
        """All numbers, ready for JSON."""
        return super().summary() | {
            "solver": {"status": self.solver_status, "converged": self.converged, "iterations": self.iterations},
            "offset_mm": [1e3 * float(value) for value in self.offset],
            "violations": self.violations,
        }


def _millimetres(offset: Array) -> str:
    return ", ".join(f"{1e3 * value:.1f}" for value in offset)


def judged(program: Program, wanted: Array, solution: Solution, rate: float) -> OfflineResult:
    """Sample the spline and compare it with what was asked."""
    arm, time, spline = program.arm, program.time, solution.spline
    parts = [np.linspace(a, b, max(int(np.ceil((b - a) * rate - 1e-9)), 1), endpoint=False) for a, b in pairwise(time)]
    grid = np.concatenate([*parts, time[-1:]])
    path = None if program.path is None else program.path + solution.offset
    result = TrackResult.of_motion(
        arm, time, wanted, grid, spline(grid), floor=program.floor, path=path, part=program.part,
        joint_weights=program.joint_weights, velocity_limits=program.speeds,
    )  # fmt: skip
    over = {
        "joint limit": np.maximum(arm.lower - result.control_positions, result.control_positions - arm.upper),
        "velocity limit": np.abs(spline.derivative(1)(grid)) - program.speeds,
        "acceleration limit": np.abs(spline.derivative(2)(grid)) - program.accelerations,
    }
    violations = {name: float(value.max()) for name, value in over.items() if value.max() > KEPT}
    if result.position_error is not None and result.position_error.max() > program.path_tolerance + ON_PATH:
        violations["path"] = float(result.position_error.max())
    return OfflineResult(
        **{one.name: getattr(result, one.name) for one in fields(TrackResult)},
        solver_status=solution.status,
        converged=solution.converged,
        iterations=solution.iterations,
        offset=solution.offset,
        violations=violations,
    )
