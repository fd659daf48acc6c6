"""Who matches whom, by name.

Each correspondence is one class that keeps the contract of `Correspondence`: built once on both recentred clouds,
asked for `Matches` under every rotation. `correspondence_of` adds the direction.
"""

from maniport.transfer.icp.correspondence.contract import Correspondence, Matches
from maniport.transfer.icp.correspondence.direction import DIRECTIONS, correspondence_of
from maniport.transfer.icp.correspondence.ellipsoid import EllipsoidCorrespondence, match, match_numpy
from maniport.transfer.icp.correspondence.features import EllipsoidFeatures
from maniport.transfer.icp.correspondence.geodesic import GeodesicCorrespondence
from maniport.transfer.icp.correspondence.log_ellipsoid import LogEllipsoidCorrespondence
from maniport.transfer.icp.correspondence.match_tree import MatchTree
from maniport.transfer.icp.correspondence.one_to_one import OneToOneCorrespondence
from maniport.transfer.icp.correspondence.transport import TransportCorrespondence

CORRESPONDENCES: dict[str, type[Correspondence]] = {
    "ellipsoid": EllipsoidCorrespondence,
    "log-ellipsoid": LogEllipsoidCorrespondence,
    "geodesic": GeodesicCorrespondence,
    "one-to-one": OneToOneCorrespondence,
    "transport": TransportCorrespondence,
}
"""The correspondences by the names that `RiemannianICP` takes."""

__all__ = [
    "CORRESPONDENCES",
    "DIRECTIONS",
    "Correspondence",
    "EllipsoidFeatures",
    "MatchTree",
    "Matches",
    "correspondence_of",
    "match",
    "match_numpy",
]
