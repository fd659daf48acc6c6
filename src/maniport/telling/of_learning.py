"""Facts of what is learned of several demonstrations: whether they agree, which one does not, what can be relied on."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from maniport.errors import argument
from maniport.pipeline.learned import LearnedProfile
from maniport.profiles.agreement import Agreement
from maniport.profiles.mixture import points_each
from maniport.telling.answer import Answer, Card
from maniport.telling.facts import Fact, Facts, Section, Table, in_axes, listed, notes, numbers, told, warnings_of
from maniport.telling.of_recording import RECORDING
from maniport.telling.of_run import software
from maniport.telling.status import status_of

AGREE, IN_PART = 0.2, 0.5
"""Shares of the variance that lie between demonstrations up to which they agree, and agree in part: with half of it the
demonstrations differ as much from one another as the motion changes over time.
"""

SAME = 1e-6
"""Nobody does a thing twice so alike."""

DISTANCE = "0.1 is one axis that is 5 % too long."


@told.register
def learned_facts(learned: LearnedProfile) -> Facts:
    """Tell what was learned, whether the demonstrations agree first."""
    k = len(learned.demonstrations)
    facts = Facts(
        f"A profile of {k} demonstrations",
        f"{k} demonstrations were brought to the {np.ptp(learned.time):.1f} s of {learned.reference.name}. At each of "
        f"{len(learned.time)} moments there is a mean ellipsoid, how much it may vary, and a place of the hand.",
        (_profile(learned), _each(learned), _done(learned)),
        doubts=(
            *warnings_of("equal-demonstrations", _twice(learned)),
            *warnings_of(RECORDING, [doubt for one in learned.demonstrations for doubt in one.doubts]),
            *warnings_of("demonstrations-differ", _differ(learned)),
        ),
    )
    return replace(facts, verdict=verdict_of(learned, facts.warning_keys))


def _twice(learned: LearnedProfile) -> list[str]:
    """Tell of demonstrations that are equal, as when one file is given twice."""
    pairs = np.argwhere(np.triu(learned.agreement.apart < SAME, 1))
    if not len(pairs):
        return []
    first, second = (learned.names[i] for i in pairs[0])
    more = f", and so are {len(pairs) - 1} other pairs" if len(pairs) > 1 else ""
    return [f"{first} and {second} are the same{more}: they agree by themselves"]


def _differ(learned: LearnedProfile) -> list[str]:
    """Report demonstrations that differ much, or one that differs from the others."""
    found = learned.agreement
    differ = "the demonstrations differ: their mean is a motion that nobody performed; see the figure"
    odd = [] if found.odd is None else [f"{learned.names[found.odd]} differs from the other demonstrations"]
    return [*([differ] if found.share > AGREE else []), *odd]


def verdict_of(learned: LearnedProfile, reasons: Sequence[str]) -> Answer:
    """Summarize whether the demonstrations agree; `reasons` are the keys of all warnings."""
    found = learned.agreement
    how = "agree" if found.share <= AGREE else "agree in part" if found.share <= IN_PART else "do not agree"
    odd = "" if found.odd is None else learned.names[found.odd]
    cards = [Card("Spread", f"{found.after:.2f}", "after alignment", (f"{found.before:.2f} before", _share(found)))]
    if found.held_out is not None:
        learnt, plain, nearest, constant = _means(found)
        beside = (f"plain mean {plain:.2f}", f"nearest other {nearest:.2f}", f"one ellipsoid for all {constant:.2f}")
        cards.append(Card("Left out", f"{learnt:.2f}", "from what the others taught", beside))
        alone, one = found.alone, int(np.argmax(found.alone))
        whose, median = f"{learned.names[one]}, from the others", f"median {np.median(alone):.2f}"
        cards.append(Card("Farthest", f"{alone[one]:.2f}", whose, (median,)))
    return Answer(
        f"The demonstrations {how}.",
        " ".join(
            [
                f"Ellipsoids of the same moment are {found.after:.2f} from their mean ({in_axes(found.after)}).",
                *([f"{odd} is the odd one."] if odd else []),
                *_foretold(found),
            ]
        ),
        "",
        f"Leave out {odd}, or give it a profile of its own." if odd else _more(learned),
        "",
        status_of(reasons),
        tuple(reasons),
        tuple(cards),
    )


def _share(found: Agreement) -> str:
    return f"{100 * found.share:.0f} % of all variance lies between the demonstrations"


def _means(found: Agreement) -> tuple[float, ...]:
    """Mean distances of demonstrations that are left out, from what is known without them."""
    assert found.held_out is not None
    held = found.held_out
    return tuple(float(np.mean(one)) for one in (held.learned, held.mean, held.nearest, held.constant))


def _foretold(found: Agreement) -> list[str]:
    """Say whether what is learned foretells a demonstration that it has not seen."""
    if found.held_out is None:
        return ["So few do not tell how far another demonstration would be."]
    learnt, plain, nearest, constant = _means(found)
    if learnt >= constant:
        return ["What is learned foretells a demonstration no better than one ellipsoid for all times does."]
    if learnt > nearest:
        return ["A demonstration is nearer to one of the others than to what all of them teach."]
    best = "best" if learnt <= plain else "better than any other does, the plain mean better still"
    return [f"What is learned foretells a demonstration that it has not seen {best}."]


def _more(learned: LearnedProfile) -> str:
    """Advise more Gaussians where the plain mean foretells better and there are ellipsoids enough."""
    found, more = learned.agreement, 2 * learned.model.n_components_
    k, n, d, _ = learned.alignment.ellipsoids.shape
    if found.held_out is None or k * n < more * points_each(d):
        return ""
    learnt, plain, *_ = _means(found)
    return f"More Gaussians may foretell better: {argument('components', more)}." if learnt > plain else ""


def _profile(learned: LearnedProfile) -> Section:
    found, model = learned.agreement, learned.model
    facts = [
        Fact("Spread", f"{found.before:.2f} before alignment, {found.after:.2f} after",
             f"Distance of ellipsoids of the same moment from their mean. {DISTANCE}", "spread",
             {"before": found.before, "after": found.after}),
        Fact("Movement", f"{found.movement:.2f}", "Distance of the learned ellipsoids from their own mean.", "movement",
             found.movement),
        Fact("Between the demonstrations", f"{100 * found.share:.0f} %", "Share of all variance.", "share",
             found.share),
        Fact("Gaussians", str(model.n_components_), key="gaussians", value=model.n_components_),
        *numbers(ellipsoids=len(learned.time), duration_s=round(float(np.ptp(learned.time)), 3)),
    ]  # fmt: skip
    if found.held_out is not None:
        learnt, plain, nearest, constant = _means(found)
        value = {"learned": learnt, "plain_mean": plain, "nearest_other": nearest, "one_for_all_times": constant}
        text = (
            f"{learnt:.2f} from what the others teach, {plain:.2f} from their plain mean, {nearest:.2f} from the "
            f"nearest of them, {constant:.2f} from one ellipsoid for all times"
        )
        facts.append(Fact("Left out", text, "Mean over the demonstrations, each left out once.", "left_out", value))
    return Section("The learned profile", tuple(facts), key="profile")


def _each(learned: LearnedProfile) -> Section:
    """One row a demonstration."""
    found, held = learned.agreement, learned.agreement.held_out
    rows: list[tuple[str, ...]] = []
    values: list[dict[str, Any]] = []
    for i, one in enumerate(learned.demonstrations):
        fit, alone = one.fit, float(found.alone[i])
        left = None if held is None else float(held.learned[i])
        shown = "" if left is None else f"{left:.2f}"
        rows.append((one.name, f"{np.ptp(fit.time):.2f} s", str(len(fit)), str(fit.arm.side), f"{alone:.2f}", shown))
        values.append({"name": one.name, "start_s": float(fit.time[0]), "stop_s": float(fit.time[-1]),
                       "frames": len(fit), "side": fit.arm.side, "from_others": alone, "left_out": left,
                       "segment_lengths_m": fit.segment_lengths})  # fmt: skip
    columns = ("demonstration", "duration", "frames", "arm", "from the others", "left out")
    caption = "Distances after alignment: mean from each other one, and from what is learned without it."
    odd = None if found.odd is None else learned.names[found.odd]
    facts = [
        Fact("Reference", learned.reference.name, "Its times are those of the profile.", "reference",
             learned.alignment.reference),
        Fact("The odd one", odd or "none", "One half as far again from the others as the median.", "odd", found.odd),
    ]  # fmt: skip
    table = Table(columns, tuple(rows), caption, "demonstrations", values)
    return Section("The demonstrations", (*facts, *notes(_said(learned))), (table,), "demonstrations")


def _said(learned: LearnedProfile) -> list[str]:
    """What was done to make the demonstrations comparable."""
    sides = Counter(one.fit.arm.side for one in learned.demonstrations)
    side = learned.arm.side
    mirrored = [one.name for one in learned.demonstrations if one.fit.arm.side != side]
    every = [one.fit.segment_lengths for one in learned.demonstrations]
    span = []
    for segment in every[0]:
        lengths = [one[segment] for one in every if segment in one]
        span.append(f"{segment} {min(lengths):.3f} to {max(lengths):.3f} m")
    whose = (
        "all ellipsoids are those of one arm with the mean lengths"
        if learned.lengths == "mean"
        else "the ellipsoids are those of arms of these lengths, so that sizes of people differ in them, too"
    )
    return [
        *([f"{sides[side]} demonstrations show the {side} arm; mirrored were {listed(mirrored)}"] if mirrored else []),
        f"lengths: {listed(span)}; {whose}",
    ]


def _done(learned: LearnedProfile) -> Section:
    spec = learned.spec
    facts = (
        Fact("Ellipsoids", f"{spec.kind}, {spec.part}", "Of the person, in the trunk frame (x forward, y left, z up).",
             "ellipsoids", {"kind": spec.kind, "part": spec.part}),
        Fact("Damping", f"{learned.regularization.epsilon:.3g}" if learned.regularization.epsilon else
             str(learned.regularization), "Added to all eigenvalues before ellipsoids are compared.", "damping",
             learned.regularization.epsilon),
        Fact("Arm", f"{learned.arm.name}, {learned.arm.side}", key="arm", value=learned.arm.name),
        *software(learned.random_state),
    )  # fmt: skip
    return Section("What was done", facts, key="run", folded=True)
