"""The paths of one or several arms that are put in one place together, such as those of a person's two hands."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from maniport.tracking.placement.journey import Journey
from maniport.tracking.plan.atlas import Atlas
from maniport.validation import Array


@dataclass(frozen=True)
class Sides:
    """A path for each arm, all around one centre, and what the arms can do.

    Places are as good as the sum of what they cost the arms, and hold all paths.

    Attributes
    ----------
    journeys : tuple of Journey
        With the same times, the same numbers that are free or given, and the same workspace.
    atlases : tuple of Atlas
        Of the arms, in one frame.
    """

    journeys: tuple[Journey, ...]
    atlases: tuple[Atlas, ...]

    @property
    def common(self) -> Journey:
        """One of the journeys, for what they share."""
        return self.journeys[0]

    def changed(self, change: Callable[[Journey], Journey]) -> "Sides":
        """The same with each journey changed alike."""
        return replace(self, journeys=tuple(change(one) for one in self.journeys))

    def thinned(self, points: int) -> "Sides":
        """The same with so many points of each path."""
        return self.changed(lambda one: one.thinned(points))

    def within(self, places: Array) -> tuple[Array, NDArray[np.bool_]]:
        """As `Journey.within`, for all paths."""
        return replace(self.common, path=np.concatenate([one.path for one in self.journeys])).within(places)

    def costs(self, places: Array, count: int) -> Array:
        """Mean costs of places (k, 7) by samples, summed over the arms; see `Journey.costs`."""
        each = [one.costs(atlas, places, count) for one, atlas in zip(self.journeys, self.atlases, strict=True)]
        return np.asarray(sum(each[1:], start=each[0]))

    def coordinates(self, places: Array) -> list[Array]:
        """Where the points of each path are for its arm at places (k, 7), whichever way that is turned; (k, n, …)."""
        return [
            atlas.coordinates(one.placed(places)[0])[0] for one, atlas in zip(self.journeys, self.atlases, strict=True)
        ]

    def centres(self, count: int, seed: np.random.Generator) -> Array:
        """Points (count, 3) amid where the arms' tips may be [m]."""
        drawn = [
            atlas.reach[seed.choice(len(atlas.reach), count, replace=len(atlas.reach) < count)]
            for atlas in self.atlases
        ]
        return np.asarray(np.mean(drawn, axis=0))
