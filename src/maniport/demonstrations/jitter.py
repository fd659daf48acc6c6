"""Jitter of points, as video keypoints have it: measured, and smoothed away by a robust spline where there is much.

Each track x of a point minimises

    Σ_t w_t |x_t - y_t|² + λ Σ_t |Δ³ x_t|²

(Eilers, Analytical Chemistry 75, 2003, with third differences). The weights w are those of Student's distribution, so
that a point which is far off now and then does not draw the track to it. λ is the one with the least generalised
cross-validation: as smooth as the data themselves say, no smoother.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import solveh_banded
from scipy.ndimage import median_filter
from scipy.special import comb

from maniport.defaults import AUTO
from maniport.demonstrations.recording import Recording, runs_of
from maniport.errors import InvalidInputError, argument, spoken
from maniport.validation import Array, as_choice, as_number

SMOOTHINGS = AUTO, OFF = AUTO, "off"
"""Words for how much is smoothed; or the highest frequency that is followed."""

ORDER = 6
"""Noise is measured in differences of this order: motion up to a seventh of the frame rate hardly shows in them."""

JITTERS = 0.004
"""Noise of a point in one direction from which it is smoothed [m]. Optical systems have 0.0001 to 0.001, skeletons of
people who climb and jump 0.002, keypoints of video 0.005 to 0.02."""

SLOWEST = 20.0
"""Frames a second below which motion cannot be told from jitter [Hz]: nothing is smoothed but what is asked for."""

LEAST_SHARE = 0.003
"""Cutoffs are at least this share of the frame rate: below it rounding of the equations moves points by millimetres
(0.1 mm here, 1 mm at two thirds of it, 200 mm at one third)."""

CUTOFFS = np.geomspace(0.8, 12.0, 15)
"""Frequencies that are tried [Hz]: those that a track is followed up to, with half the amplitude there."""

TAILS = 4.0
"""Degrees of freedom of Student's distribution of the noise."""

CHI_SQUARED = 2.366
"""The median of chi-squared with three degrees of freedom."""

AROUND = 15
"""Frames whose noise is compared."""

TINY = 1e-18
"""Noise below this is rounding [m²]."""

ROUNDS = 6
"""Weights are found in so many rounds."""

FEWEST = 12
"""Shorter runs of frames are left as they are."""


def noise(track: Array) -> float:
    """Standard deviation of a track's noise in one direction [m], shape (n, 3); robust, nan where nothing tells."""
    differences = np.abs(np.diff(track, ORDER, axis=0))
    if not np.isfinite(differences).any():
        return float("nan")
    return float(np.nanmedian(differences) / 0.6745 / np.sqrt(comb(2 * ORDER, ORDER)))


def as_smoothing(value: Any) -> float | None:
    """Check how much is to be smoothed: the highest frequency [Hz], infinite for "off", None for "auto"."""
    if isinstance(value, str):
        try:
            value = float(value)  # as it was typed
        except ValueError:
            return None if as_choice(value, "smooth", SMOOTHINGS) == AUTO else np.inf
    return as_number(value, "smooth [Hz]", above=0.0)


def smoothed(recording: Recording, cutoff: float | None = None) -> Recording:
    """Smooth the points that jitter; that they do, and how they are smoothed, is said in `doubts`."""
    amounts = np.array([noise(recording.positions[:, i]) for i in range(len(recording.names))])
    least = LEAST_SHARE * recording.rate
    if cutoff is not None and cutoff < least:
        raise InvalidInputError(
            f"{spoken('smooth')} must be at least {least:.3g} Hz for {recording.rate:.4g} frames a second; "
            f"found {cutoff:g}"
        )
    jittering = np.flatnonzero((amounts > JITTERS) & (recording.rate >= SLOWEST) & (least <= CUTOFFS[-1]))
    who = ", ".join(recording.names[i] for i in jittering)
    jitter = f"{who} jitter by {_span(1e3 * amounts[jittering])} mm" if len(jittering) else ""
    if cutoff == np.inf:
        doubt = f"{jitter}; {argument('smooth', AUTO)} smooths them"
        return replace(recording, doubts=(*recording.doubts, doubt)) if jitter else recording
    positions, used = recording.positions.copy(), []
    for i in jittering if cutoff is None else range(len(amounts)):
        for start, stop in runs_of(np.isfinite(positions[:, i, 0])):
            if stop - start >= FEWEST:
                positions[start:stop, i], followed = _robust_spline(positions[start:stop, i], recording.rate, cutoff)
                used.append(followed)
    if not used:
        return recording
    how = f"smoothed: motion is followed up to {_span(used)} Hz"
    if cutoff is not None:
        return replace(recording, positions=positions, notes=(*recording.notes, f"{how}, as asked for"))
    doubt = f"{jitter} and were {how}; {argument('smooth', OFF)} leaves them as they are"
    return replace(recording, positions=positions, doubts=(*recording.doubts, doubt))


def _span(values: Array | list[float]) -> str:
    """Say from where to where values go, to two digits."""
    low, high = f"{np.nanmin(values):.2g}", f"{np.nanmax(values):.2g}"
    return low if low == high else f"{low} to {high}"


def _robust_spline(track: Array, rate: float, cutoff: float | None) -> tuple[Array, float]:
    """Smooth one run of frames (n, 3); return it with the frequency up to which it follows [Hz]."""
    tried = [cutoff] if cutoff is not None else [f for f in CUTOFFS if LEAST_SHARE * rate <= f < 0.45 * rate]
    weight, least = np.ones(len(track)), max(noise(track) ** 2, TINY)
    found = (np.inf, track, float(tried[0]))
    for _ in range(ROUNDS):
        found = min((_spline(track, weight, f, rate) for f in tried), key=lambda one: one[0])
        squares = np.sum((track - found[1]) ** 2, axis=-1)
        # A point that is off for a moment counts less; where motion is too fast for the spline for longer it does not.
        scale = median_filter(squares, AROUND, mode="nearest") / CHI_SQUARED
        weight = (TAILS + 3) / (TAILS + squares / np.maximum(scale, least))
    return found[1], found[2]


def _spline(track: Array, weight: Array, cutoff: float, rate: float) -> tuple[float, Array, float]:
    """Generalised cross-validation, smooth track and cutoff."""
    n = len(track)
    strength = (2 * np.sin(np.pi * min(cutoff / rate, 0.5))) ** -6.0  # half the amplitude is left at the cutoff
    matrix = strength * _third_differences(n)
    matrix[0] += weight
    result = solveh_banded(matrix, weight[:, None] * track, lower=True)
    waves = (2 * np.sin(np.pi * (np.arange(n) + 0.5) / (2 * n))) ** 6
    freedom = np.sum(1 / (1 + strength / weight.mean() * waves))
    error = np.sum(weight * np.sum((track - result) ** 2, axis=-1)) / weight.sum()
    return float(error / (1 - freedom / n) ** 2), np.asarray(result), cutoff


def _third_differences(n: int) -> Array:
    """The matrix DᵀD of third differences as lower bands, shape (4, n)."""
    pattern = np.array([-1.0, 3.0, -3.0, 1.0])
    bands = np.zeros((4, n))
    for offset in range(4):
        for k in range(4 - offset):
            bands[offset, k : n - 3 + k] += pattern[k] * pattern[k + offset]
    return bands
