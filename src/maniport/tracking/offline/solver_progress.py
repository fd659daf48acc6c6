"""How far IPOPT is, as far as one can know."""

from typing import Any

import numpy as np

from maniport.optional import casadi
from maniport.steps import Part

USUAL = 15
"""After as many iterations two thirds of the way are told: most motions take two to four times as many."""

GO_ON, STOP = 0, 1
"""What CasADi takes as answers."""


def iteration_callback(problem: dict[str, Any], tell: Part) -> Any:
    """Make a CasADi callback for the option ``iteration_callback``: it tells 1 − exp(−iterations / USUAL).

    Parameters
    ----------
    problem : dict
        ``"x"``, ``"f"`` and ``"g"``, as for `casadi.nlpsol`.
    tell : callable

    Returns
    -------
    casadi.Callback
        To be kept until the solver has ended. What `tell` raises stops the solver and is in ``raised`` then, since
        CasADi lets nothing through.
    """
    ca = casadi()
    sizes = {"f": 1, **dict.fromkeys(("x", "lam_x"), problem["x"].numel())}
    sizes |= dict.fromkeys(("g", "lam_g"), problem["g"].numel())

    class Iterations(ca.Callback):  # type: ignore[misc,name-defined]  # CasADi is untyped
        def __init__(self) -> None:
            ca.Callback.__init__(self)
            self.count = 0
            self.raised: BaseException | None = None
            self.construct("iterations", {})

        def get_n_in(self) -> int:
            return int(ca.nlpsol_n_out())

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, i: int) -> Any:
            return ca.Sparsity.dense(sizes.get(ca.nlpsol_out(i), 0), 1)

        def eval(self, arguments: Any) -> list[int]:
            self.count += 1
            try:
                tell(1.0 - float(np.exp(-self.count / USUAL)))
            except BaseException as error:  # noqa: BLE001  # raised again by the caller; Ctrl-C too
                self.raised = error
                return [STOP]
            return [GO_ON]

    return Iterations()
