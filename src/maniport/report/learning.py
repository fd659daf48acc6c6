"""Report of what is learned from several demonstrations: agreement, outliers, prediction of held-out ones."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from maniport.errors import argument
from maniport.learning.agreement import Agreement
from maniport.learning.mixture import points_each
from maniport.pipeline.learned import LearnedProfile
from maniport.report.metrics import describe, in_axes, listed, notes, numbers, status_of, table_of, warnings_of
from maniport.report.recording import RECORDING
from maniport.report.runs import software
from maniport.report.values import Metric, Report, Section, Summary

AGREE, IN_PART = 0.2, 0.5  # Shares of the variance between demonstrations up to which they agree, and agree in part


@describe.register
def learned_report(learned: LearnedProfile) -> Report:
    """Report a learned profile, agreement of the demonstrations first."""
    k = len(learned.demonstrations)
    quality_warnings = (
        *warnings_of("equal-demonstrations", _equal(learned)),
        *warnings_of(RECORDING, [doubt for one in learned.demonstrations for doubt in one.quality_warnings]),
        *warnings_of("demonstrations-differ", _differ(learned)),
    )
    lead = (
        f"{k} demonstrations, aligned to the {np.ptp(learned.time):.1f} s of {learned.reference.name}. Each of "
        f"{len(learned.time)} times has a mean ellipsoid, its covariance, and a position of the hand."
    )
    sections = (_profile(learned), _demonstrations(learned), _settings(learned))
    report = Report(f"A profile of {k} demonstrations", lead, sections, data_warnings=quality_warnings)
    return replace(report, summary=_summary(learned, report.warning_keys))


def _equal(learned: LearnedProfile) -> list[str]:
    """Name demonstrations that are equal, as when one file is given twice."""
    pairs = [f"{learned.names[i]} and {learned.names[k]}"
             for i, k in np.argwhere(np.triu(learned.agreement.apart < 1e-6, 1))]  # fmt: skip
    return [f"{listed(pairs)} are the same: their agreement has no meaning"] if pairs else []


def _differ(learned: LearnedProfile) -> list[str]:
    """Report demonstrations that differ much, or one that differs from the others."""
    found = learned.agreement
    differ = "the demonstrations differ: their mean is a motion that nobody performed"
    outlier = [] if found.outlier is None else [f"{learned.names[found.outlier]} differs from the other demonstrations"]
    return [*([differ] if found.share > AGREE else []), *outlier]


def _summary(learned: LearnedProfile, reasons: Sequence[str]) -> Summary:
    """Summarize whether the demonstrations agree; `reasons` are the keys of all warnings."""
    found = learned.agreement
    how = "agree" if found.share <= AGREE else "agree in part" if found.share <= IN_PART else "do not agree"
    outlier = "" if found.outlier is None else learned.names[found.outlier]
    texts = [
        f"The mean distance to the mean ellipsoid of the same time is {found.after:.2f} ({in_axes(found.after)}).",
        *([f"{outlier} is an outlier."] if outlier else []),
    ]
    advice = f"Leave out {outlier}, or give it a profile of its own." if outlier else _more(learned)
    title = f"The demonstrations {how}."
    return Summary(title, " ".join(texts), advice, "", status_of(reasons), tuple(reasons), tuple(_agreement(found)))


def _held_out(found: Agreement) -> dict[str, float]:
    """Mean distances of held-out demonstrations from predictions by the others."""
    held = found.held_out
    assert held is not None
    values = {"learned": held.learned, "plain_mean": held.mean, "nearest_other": held.nearest,
              "one_for_all_times": held.constant}  # fmt: skip
    return {name: float(np.mean(distances)) for name, distances in values.items()}


def _more(learned: LearnedProfile) -> str:
    """Advise more Gaussians where the plain mean predicts better and there are enough ellipsoids."""
    found, more = learned.agreement, 2 * learned.model.n_components_
    k, n, d, _ = learned.alignment.ellipsoids.shape
    if found.held_out is None or k * n < more * points_each(d):
        return ""
    held = _held_out(found)
    text = f"More Gaussians may predict better: {argument('components', more)}."
    return text if held["learned"] > held["plain_mean"] else ""


def _agreement(found: Agreement) -> list[Metric]:
    """Return how alike the demonstrations are."""
    metrics = [
        Metric("Dispersion", f"{found.after:.2f} after alignment, {found.before:.2f} before",
               "Mean distance to the mean ellipsoid of the same time; 0.1 is one axis 5 % too long.", "spread",
               {"before": found.before, "after": found.after}),
        Metric("Variance between demonstrations", f"{100 * found.share:.0f} %", "Share of all variance.", "share",
               found.share),
    ]  # fmt: skip
    if found.held_out is not None:
        held = _held_out(found)
        text = listed(f"{value:.2f} to {name.replace('_', ' ')}" for name, value in held.items())
        metrics.append(Metric("Leave-one-out distance", text, "Mean over the demonstrations.", "left_out", held))
    return metrics


def _profile(learned: LearnedProfile) -> Section:
    movement, gaussians = learned.agreement.movement, learned.model.n_components_
    metrics = (
        *_agreement(learned.agreement),
        Metric("Movement", f"{movement:.2f}", "Mean distance of the profile from its mean.", "movement", movement),
        Metric("Gaussians", str(gaussians), key="gaussians", value=gaussians),
        *numbers(ellipsoids=len(learned.time), duration_s=round(float(np.ptp(learned.time)), 3)),
    )
    return Section("Learned profile", metrics, key="profile")


def _demonstrations(learned: LearnedProfile) -> Section:
    """List the demonstrations."""
    found, held = learned.agreement, learned.agreement.held_out
    values = [
        {"name": one.name, "start_s": float(one.motion.time[0]), "stop_s": float(one.motion.time[-1]),
         "frames": len(one.motion), "side": listed(one.motion.names), "from_others": float(found.alone[i]),
         "left_out": None if held is None else float(held.learned[i]),
         "segment_lengths_m": {side: fit.segment_lengths
                               for side, fit in zip(one.motion.names, one.motion.arms, strict=True)}}
        for i, one in enumerate(learned.demonstrations)
    ]  # fmt: skip
    columns = {"demonstration": "{name}", "start": "{start_s:.2f} s", "stop": "{stop_s:.2f} s", "frames": "{frames}",
               "arm": "{side}", "from the others": "{from_others:.2f}"}  # fmt: skip
    if held is not None:
        columns["held out"] = "{left_out:.2f}"
    caption = "Mean distances after alignment: from the others, and from the profile learned without it."
    outlier = None if found.outlier is None else learned.names[found.outlier]
    metrics = (
        Metric("Reference", learned.reference.name, "Gives the times of the profile.", "reference",
               learned.alignment.reference),
        Metric("Outlier", outlier or "none", "At least 1.5 times the median distance from the others.", "odd",
               found.outlier),
        *notes(_preparation(learned)),
    )  # fmt: skip
    table = table_of(values, columns, caption, "demonstrations")
    return Section("Demonstrations", metrics, (table,), "demonstrations")


def _preparation(learned: LearnedProfile) -> list[str]:
    """Report what made the demonstrations comparable: mirroring and segment lengths."""
    sides = tuple(str(arm.side) for arm in learned.arms)
    mirrored = [one.name for one in learned.demonstrations if one.motion.names != sides]
    arm = f"{len(sides)} arms of mean lengths" if len(sides) > 1 else "one arm of mean lengths"
    arm = arm if learned.lengths == "mean" else "arms that differ in size"
    mirrors = [f"mirrored to the {sides[0]} arm: {listed(mirrored)}"] if mirrored else []
    return [*mirrors, f"all ellipsoids are those of {arm}"]


def _settings(learned: LearnedProfile) -> Section:
    spec, damping = learned.spec, learned.regularization.epsilon
    metrics = (
        Metric("Ellipsoids", f"{spec.kind}, {spec.part}", "Trunk frame (x forward, y left, z up).", "ellipsoids",
               {"kind": spec.kind, "part": spec.part}),
        Metric("Damping", f"{damping:.3g}" if damping else str(learned.regularization),
               "Added to all eigenvalues before ellipsoids are compared.", "damping", damping),
        Metric("Arm", listed(f"{arm.name}, {arm.side}" for arm in learned.arms), key="arm",
               value=listed(arm.name for arm in learned.arms)),
        *software(learned.random_state),
    )  # fmt: skip
    return Section("Settings", metrics, key="run", folded=True)
