"""What every contestant is measured on, and the measuring."""

import warnings
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from maniport.bodies import Arm
from maniport.errors import ManiportWarning
from maniport.evaluation.accuracy import rmse
from maniport.evaluation.alternatives import Alternative
from maniport.evaluation.draws import Draws
from maniport.evaluation.faithfulness import STILL, smoothness, structure
from maniport.evaluation.reliability import identity_test, stability
from maniport.evaluation.result import Gaps, Row
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.cloud import energy_between, log_vectors, mean_distance
from maniport.spd.mean import mean
from maniport.tracking.search.feasible import nearest_feasible
from maniport.transfer import name_of
from maniport.validation import Array

OWN_SAMPLES = "student's own fresh samples"


@dataclass(frozen=True)
class StudentCloud:
    """The student's regularised domain and what every comparison with it needs: its mean, log-vectors and spread."""

    points: Array
    center: Array
    vectors: Array
    within: float

    @classmethod
    def of(cls, points: Array) -> "StudentCloud":
        """Prepare regularised points, shape (m, d, d)."""
        center = mean(points)
        vectors = log_vectors(points, center)
        return cls(points, center, vectors, mean_distance(vectors))

    def energy_distance(self, points: Array) -> float:
        """Energy distance of other points (n, d, d) to this cloud, about its mean."""
        return energy_between(log_vectors(points, self.center), self.vectors, self.within)


@dataclass(frozen=True)
class Bench:
    """What every contestant is measured on.

    Attributes
    ----------
    clouds : (ndarray, ndarray), shapes (N, d, d) and (M, d, d)
        Domains of teacher and student, as they were given.
    profile, probes : ndarray, shapes (n, d, d) and (k, d, d)
        The teacher's motion and samples of its domain, as they were given; images are taken of both.
    original : ndarray, shape (n, d, d)
        The profile with the teacher's regularisation.
    truth : ndarray, shape (n, d, d), or None
        What it should become, with the student's.
    student : StudentCloud
    fresh : ndarray
        Fresh samples of the student, with its regularisation.
    identity : (ndarray, ndarray)
        Two draws for the identity test.
    draws : Draws or None
    """

    clouds: tuple[Array, Array]
    profile: Array
    original: Array
    truth: Array | None
    probes: Array
    student: StudentCloud
    fresh: Array
    identity: tuple[Array, Array]
    draws: Draws | None

    @cached_property
    def moves(self) -> bool:
        """Whether the teacher's ellipsoids change at all; what compares motion does not apply otherwise."""
        return bool(np.max(distance_unchecked(self.original[:1], self.original)) > STILL)

    def measure(self, one: Alternative, fitted: bool, options: dict[str, Any]) -> tuple[Row, Array]:
        """Fit unless `fitted`, and measure all but the feasibility gap; also return the images of profile and probes.

        `options` go to `fit` wherever the adapter is fitted to these domains again.
        """
        if one.adapter is None:
            return Row(one.name, one.note), np.empty((0, *self.profile.shape[1:]))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ManiportWarning)
            adapter = one.adapter if fitted else one.adapter.fit(*self.clouds)
            images = [adapter.transform(points) for points in (self.profile, self.probes) if len(points)]
            mapped = adapter.student_side(images[0])
            domain = adapter.student_side(adapter.transform(self.clouds[0]))
            row = Row(
                one.name,
                one.note,
                name_of(adapter),
                rmse=None if self.truth is None else rmse(self.truth, mapped),
                smoothness=smoothness(mapped, self.original) if self.moves else None,
                structure=structure(mapped, self.original) if self.moves else None,
                energy_distance=self.student.energy_distance(domain),
                identity=identity_test(adapter, *self.identity),
                stability=None if self.draws is None else stability(adapter, *self.draws.both, self.profile, **options),
            )
        texts = dict.fromkeys(str(warning.message) for warning in caught)
        return replace(row, warnings=tuple(texts)), np.concatenate(images)

    def with_feasibility_gaps(
        self, rows: list[Row], images: list[Array], robot: Arm, search: dict[str, Any]
    ) -> list[Row]:
        """Measure the feasibility gap of all images in one go, which shares the search's preparation."""
        n, ends = len(self.profile), np.cumsum([len(mapped) for mapped in images])
        distances = np.split(nearest_feasible(robot, np.concatenate(images), **search).distance, ends[:-1])
        return [
            replace(
                row,
                feasibility_gap=Gaps.of(found[:n]) if len(found) else None,
                domain_feasibility_gap=Gaps.of(found[n:]) if len(found) > n else None,
            )
            for row, found in zip(rows, distances, strict=True)
        ]

    def noise(self) -> Row:
        """What fresh samples of the student score against its own domain."""
        return Row(OWN_SAMPLES, energy_distance=self.student.energy_distance(self.fresh))
