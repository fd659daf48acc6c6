"""Facts of what comes before the transfer: fitted persons, several demonstrations."""

from dataclasses import replace

import numpy as np

from maniport.demonstrations import ArmFit, ArmFits
from maniport.profiles import ProfileGMM
from maniport.profiles.alignment import Alignment
from maniport.telling.facts import (
    Fact,
    Facts,
    Section,
    Table,
    at_moment,
    listed,
    notes,
    numbers,
    spread,
    told,
    warnings_of,
)

FIT = "human-model"
"""Key of warnings that the fitted model and the person differ."""


@told.register
def fit_facts(fit: ArmFit) -> Facts:
    """Tell how well an arm fits a person."""
    return Facts(
        f"{fit.arm.name}, fitted to a person", sections=(person_section(fit),), doubts=warnings_of(FIT, fit.doubts)
    )


@told.register
def fits_facts(fits: ArmFits) -> Facts:
    """Tell how well both arms fit a person."""
    apart = np.linalg.norm(fits.hands[1] - fits.hands[0], axis=-1)
    both = Section(
        "Both arms", (spread("Between the hands", "between_hands", apart, fits.time, "m", "From one to the other."),)
    )
    title = f"{fits.left.arm.name} and {fits.right.arm.name}, fitted to a person"
    return Facts(title, sections=(both, *each_person_section(fits)), doubts=warnings_of(FIT, fits.doubts))


def each_person_section(fits: ArmFits) -> list[Section]:
    """Tell of each arm as `person_section` does of one."""
    sides = [(str(fit.arm.side), fit) for fit in fits.each]
    return [replace(person_section(fit), title=f"The person's {side} arm", key=side) for side, fit in sides]


def person_section(fit: ArmFit) -> Section:
    """Tell how well an arm fits a person, and what the recording leaves open."""
    lengths = {name: round(float(length), 4) for name, length in fit.segment_lengths.items()}
    step, step_at = fit.largest_step
    at_limit = {name: float(part) for name, part in zip(fit.joint_names, fit.at_limit, strict=True) if part > 0}
    facts = [
        *_open(fit),
        Fact("Person", f"{fit.arm.name}, {len(fit)} frames, {fit.time[0]:.2f} to {fit.time[-1]:.2f} s",
             key="model", value=fit.arm.name),
        Fact("Arm", f"{fit.arm.side}: {fit.side_reason}", key="side", value=fit.arm.side),
        *numbers(frames=len(fit), joints_not_determined=fit.undetermined),
        Fact("Segments", listed([f"{name} {length:.3f} m" for name, length in lengths.items()]),
             "The model is scaled to these lengths.", key="segment_lengths", value=lengths, unit="m"),
        Fact("Largest joint step", f"{step:.1f}° {at_moment(step_at)}", "From frame to frame; a jump shows here.",
             key="largest_joint_step", value=step, unit="°"),
        Fact("Joints at a limit", listed([f"{name} {100 * part:.0f} %" for name, part in at_limit.items()]),
             "Part of the frames; a joint at its limit may have wanted to go further.",
             key="fraction_at_limit", value=at_limit),
        *notes(fit.notes),
    ]  # fmt: skip
    residuals = fit.residual_summary()
    rows = tuple(
        (name, *(f"{one[key]:.2f}°" for key in ("median", "p95", "max")), at_moment(one["max_at_s"]))
        for name, one in residuals.items()
    )
    caption = (
        "How well the arm fits the person: angle between the measured and the modelled direction of each segment, and "
        "its turn about its own axis where the recording shows one."
    )
    table = Table(("direction of", "median", "95 %", "largest", "when"), rows, caption, "residual_deg", residuals)
    return Section("The person", tuple(facts), (table,), "person")


def _open(fit: ArmFit) -> list[Fact]:
    """Name the joints that are not determined, once for each reason."""
    grouped: dict[str, list[str]] = {}
    for name, reason in fit.undetermined.items():
        grouped.setdefault(reason, []).append(name)
    texts = [f"The recording does not determine {listed(names)}: {why}" for why, names in grouped.items()]
    return [*warnings_of("undetermined-joints", texts)]


@told.register
def alignment_facts(alignment: Alignment) -> Facts:
    """Tell what was aligned, and how far apart it was."""
    k, n, d, _ = alignment.ellipsoids.shape
    far = [f"{one:.3g}" for one in alignment.distances[:10]]
    facts = (
        Fact("Demonstrations", str(k), key="demonstrations", value=k),
        Fact("Times", f"{n}, from {alignment.time[0]:.4g} to {alignment.time[-1]:.4g}", key="times", value=n),
        Fact("Ellipsoids", f"{d} × {d}"),
        Fact("Reference", f"number {alignment.reference}", key="reference", value=alignment.reference),
        Fact("Distances", listed(far) + (", …" if k > 10 else ""), key="distances", value=alignment.distances.tolist()),
    )
    return Facts("Demonstrations on one time", "", (Section("", facts),))


@told.register
def gmm_facts(model: ProfileGMM) -> Facts:
    """Tell what a mixture is made of, and how well it fits."""
    parameters = Fact("Parameters", repr(model))
    if not hasattr(model, "n_demonstrations_"):  # the last that a fit sets
        state = Fact("State", "not fitted yet; call fit(inputs, ellipsoids)")
        return Facts("A mixture of profiles", "", (Section("", (parameters, state)),))
    d, weights = model.means_.shape[-1], model.weights_
    facts = (
        parameters,
        Fact("Gaussians", str(model.n_components_), key="gaussians", value=model.n_components_),
        Fact("Weights", listed([f"{one:.2f}" for one in weights]), key="weights", value=weights.tolist()),
        Fact("Ellipsoids", f"{d} × {d}"),
        Fact("Demonstrations", str(model.n_demonstrations_), key="demonstrations", value=model.n_demonstrations_),
        Fact("Mean log-likelihood", f"{model.log_likelihood_:.4g}", key="mean_log_likelihood",
             value=float(model.log_likelihood_)),
        Fact("Converged", "yes" if model.converged_ else "no", key="converged", value=bool(model.converged_)),
    )  # fmt: skip
    return Facts("A mixture of profiles", "", (Section("", facts),))
