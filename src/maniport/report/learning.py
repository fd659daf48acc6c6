"""Report of what is learned from several demonstrations: agreement, outliers, prediction of held-out ones."""

import numpy as np

from maniport.errors import argument
from maniport.learning.mixture import points_each
from maniport.pipeline.demonstrations import LearnedProfile
from maniport.report.metrics import describe, in_axes
from maniport.report.recording import RECORDING
from maniport.report.results import software
from maniport.report.values import Metric, Report, Section, Summary, info, listed, notes, numbers, table_of, warnings_of

GRADES = {"agree": 0.2, "agree in part": 0.5, "do not agree": np.inf}
"""Largest shares of the variance between demonstrations by words."""


@describe.register
def learned_report(learned: LearnedProfile) -> Report:
    """Report a learned profile, agreement of the demonstrations first."""
    agreement, names, k = learned.agreement, learned.names, len(learned.demonstrations)
    outlier = "" if agreement.outlier is None else names[agreement.outlier]
    grade = next(words for words, bound in GRADES.items() if agreement.share <= bound)
    equal = [f"{names[i]} and {names[j]}" for i, j in np.argwhere(np.triu(agreement.apart < 1e-6, 1))]
    differ = "the demonstrations differ: their mean is a motion that nobody performed"
    texts = [differ] if grade != next(iter(GRADES)) else []
    texts += [f"{outlier} differs from the other demonstrations"] if outlier else []
    data_warnings = (
        *warnings_of(
            "equal-demonstrations", [f"{listed(equal)} are the same: their agreement has no meaning"] if equal else []
        ),
        *warnings_of(RECORDING, [text for part in learned.demonstrations for text in part.quality_warnings]),
        *warnings_of("demonstrations-differ", texts),
    )
    lead = (
        f"{k} demonstrations, aligned to the {np.ptp(learned.time):.1f} s of {learned.reference.name}. Each of "
        f"{len(learned.time)} times has a mean ellipsoid, its covariance, and a position of the hand."
    )
    after = agreement.after
    text = f"The mean distance to the mean ellipsoid of the same time is {after:.2f} ({in_axes(after)})."
    text += f" {outlier} is an outlier." if outlier else ""
    held_out = _held_out(learned)
    advice, components = "", 2 * learned.model.n_components_
    _, n, d, _ = learned.alignment.ellipsoids.shape
    if outlier:
        advice = f"Leave out {outlier}, or give it a profile of its own."
    elif held_out and k * n >= components * points_each(d) and held_out["learned"] > held_out["plain_mean"]:
        advice = f"More Gaussians may predict better: {argument('components', components)}."
    sections = (_profile(learned, held_out), _demonstrations(learned, outlier), _settings(learned))
    summary = Summary(f"The demonstrations {grade}.", text, advice)
    return Report(f"A profile of {k} demonstrations", lead, sections, summary, data_warnings)


def _held_out(learned: LearnedProfile) -> dict[str, float]:
    """Mean distances of held-out demonstrations from predictions by the others; empty where there are none."""
    if (held := learned.agreement.held_out) is None:
        return {}
    values = {"learned": held.learned, "plain_mean": held.mean, "nearest_other": held.nearest,
              "one_for_all_times": held.constant}  # fmt: skip
    return {name: float(np.mean(distances)) for name, distances in values.items()}


def _profile(learned: LearnedProfile, held_out: dict[str, float]) -> Section:
    agreement, movement = learned.agreement, learned.agreement.movement
    before, after = agreement.before, agreement.after
    text = listed(f"{value:.2f} to {name.replace('_', ' ')}" for name, value in held_out.items())
    metrics = [
        info("Dispersion", "dispersion", {"before": before, "after": after},
             f"{after:.2f} after alignment, {before:.2f} before",
             "Mean distance to the mean ellipsoid of the same time; 0.1 is one axis 5 % too long.", main=True),
        info("Variance between demonstrations", "variance_share", agreement.share, f"{100 * agreement.share:.0f} %",
             "Share of all variance.", main=True),
        *([info("Leave-one-out distance", "held_out", held_out, text, "Mean over the demonstrations.", main=True)]
          if held_out else []),
        info("Movement", "movement", movement, f"{movement:.2f}", "Mean distance of the profile from its mean."),
        info("Gaussians", "gaussians", learned.model.n_components_),
        *numbers(ellipsoids=len(learned.time), duration_s=round(float(np.ptp(learned.time)), 3)),
    ]  # fmt: skip
    return Section("Learned profile", tuple(metrics), key="profile")


def _demonstrations(learned: LearnedProfile, outlier: str) -> Section:
    """List the demonstrations, and report what made them comparable: mirroring and segment lengths."""
    agreement, held = learned.agreement, learned.agreement.held_out
    sides = tuple(str(arm.side) for arm in learned.arms)
    values = [
        {"name": part.name, "start_s": float(part.motion.time[0]), "stop_s": float(part.motion.time[-1]),
         "frames": len(part.motion), "side": listed(part.motion.names), "from_others": float(agreement.alone[i]),
         "held_out": None if held is None else float(held.learned[i]),
         "segment_lengths_m": {fit.arm.side: fit.segment_lengths for fit in part.motion.arms}}
        for i, part in enumerate(learned.demonstrations)
    ]  # fmt: skip
    columns = {"demonstration": "{name}", "start": "{start_s:.2f} s", "stop": "{stop_s:.2f} s", "frames": "{frames}",
               "arm": "{side}", "from the others": "{from_others:.2f}"}  # fmt: skip
    if held is not None:
        columns["held out"] = "{held_out:.2f}"
    caption = "Mean distances after alignment: from the others, and from the profile learned without it."
    mirrored = [part.name for part in learned.demonstrations if part.motion.names != sides]
    metrics = (
        info("Reference", "reference", learned.alignment.reference, learned.reference.name,
             "Gives the times of the profile."),
        info("Outlier", "outlier", agreement.outlier, outlier or "none",
             "At least 1.5 times the median distance from the others."),
        *notes([f"mirrored to the {sides[0]} arm: {listed(mirrored)}"] if mirrored else []),
        *notes([f"all ellipsoids are those of {' and '.join(sides)} arm of mean lengths"]),
    )  # fmt: skip
    return Section("Demonstrations", metrics, (table_of(values, columns, caption, "demonstrations"),), "demonstrations")


def _settings(learned: LearnedProfile) -> Section:
    spec, damping = learned.spec, learned.regularization.epsilon
    metrics: tuple[Metric, ...] = (
        info("Ellipsoids", "ellipsoids", {"kind": spec.kind, "part": spec.part}, f"{spec.kind}, {spec.part}",
             "Trunk frame (x forward, y left, z up)."),
        info("Damping", "damping", damping, f"{damping:.3g}" if damping else str(learned.regularization),
             "Added to all eigenvalues before ellipsoids are compared."),
        info("Arm", "arm", listed(arm.name for arm in learned.arms),
             listed(f"{arm.name}, {arm.side}" for arm in learned.arms)),
        *software(learned.random_state),
    )  # fmt: skip
    return Section("Settings", metrics, key="run", folded=True)
