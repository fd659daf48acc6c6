"""Who matches whom: correspondences by name, and the contract that one of your own keeps.

Each is one frozen dataclass of its options that derives from `Correspondence`.
"""

from maniport.errors import InvalidInputError
from maniport.transfer.icp.correspondence.contract import Correspondence, Matches
from maniport.transfer.icp.correspondence.distances import (
    GeodesicCorrespondence,
    OneToOneCorrespondence,
    TransportCorrespondence,
)
from maniport.transfer.icp.correspondence.ellipsoid import EllipsoidCorrespondence, LogEllipsoidCorrespondence
from maniport.validation import as_choice

CORRESPONDENCES: dict[str, type[Correspondence]] = {
    "ellipsoid": EllipsoidCorrespondence,
    "log-ellipsoid": LogEllipsoidCorrespondence,
    "geodesic": GeodesicCorrespondence,
    "one-to-one": OneToOneCorrespondence,
    "transport": TransportCorrespondence,
}
"""The correspondences by the names that `RiemannianICP` takes."""


def correspondence_of(value: str | Correspondence) -> Correspondence:
    """Return a correspondence: the one of that name with its defaults, or the one that is given."""
    if isinstance(value, Correspondence):
        return value
    if isinstance(value, str):
        return CORRESPONDENCES[as_choice(value, "correspondence", tuple(CORRESPONDENCES))]()
    raise InvalidInputError(
        f"correspondence must be one of {', '.join(map(repr, CORRESPONDENCES))} or a Correspondence; found {value!r}"
    )


__all__ = [
    "CORRESPONDENCES",
    "Correspondence",
    "EllipsoidCorrespondence",
    "GeodesicCorrespondence",
    "LogEllipsoidCorrespondence",
    "Matches",
    "OneToOneCorrespondence",
    "TransportCorrespondence",
    "correspondence_of",
]
