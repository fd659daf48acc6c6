"""The degrees of freedom of an arm: their units, and the table that a notebook shows."""

import numpy as np

from maniport.bodies.chain import REVOLUTE, Chain
from maniport.bodies.joint_space import JointSpace
from maniport.notebook import Grid, ShownInNotebooks


def joint_units(chain: Chain) -> tuple[str, ...]:
    """Unit of each degree of freedom: ``"rad"``, or ``"m"`` where it moves slides only."""
    turns = np.array([joint.kind == REVOLUTE for joint in chain.joints])
    return tuple("rad" if np.any(turns & (column != 0)) else "m" for column in chain.coupling.T)


class ShownArm(JointSpace, ShownInNotebooks):
    """What a notebook shows of an arm."""

    frame: str
    frames: tuple[str, ...]
    _chain: Chain

    def _facts(self) -> dict[str, object]:
        return {"name": self.name, "degrees of freedom": self.dof, "tip": self.frame, "frames": ", ".join(self.frames)}

    def _grid(self) -> Grid:
        speeds = np.full(self.dof, np.inf) if self.velocity_limits is None else self.velocity_limits
        rows = []
        limits = zip(self.joint_names, joint_units(self._chain), self.lower, self.upper, speeds, strict=True)
        for name, unit, low, high, speed in limits:
            span = f"{low:.3f} to {high:.3f} {unit}"
            if unit == "rad":  # people think in degrees
                span += f" ({np.degrees(low):.0f}° to {np.degrees(high):.0f}°)"
            rows.append((name, span, f"{speed:.3g} {unit}/s" if speed < np.inf else "not known"))
        return Grid(("joint", "limits", "largest speed"), rows)
