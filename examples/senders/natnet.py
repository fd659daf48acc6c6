"""Frames of OptiTrack Motive by NatNet for ``maniport live``.

Needs ``NatNetClient.py`` of the NatNet SDK 4 (``Samples/PythonClient``) next to this file. In Motive, stream *Marker
Sets* and *Labeled Markers*, with *Up Axis* Z or Y. ``python natnet.py --record me.npz``, then ``maniport live me.npz
--robot panda --udp 9000`` and ``python natnet.py``.
"""

import queue
from collections.abc import Iterator, Mapping, Sequence
from typing import Protocol

from sending import Frames, Points, Position, run

ALL = "all"  # the set of all markers of Motive, without names of its own


class MarkerSet(Protocol):
    """A marker set in a frame of NatNet."""

    model_name: bytes | str
    marker_pos_list: Sequence[Sequence[float]]


def text(name: bytes | str) -> str:
    """Return a name, which NatNet has as bytes."""
    return name.decode("utf-8") if isinstance(name, bytes) else str(name)


def points_of(sets: Sequence[MarkerSet], names: Mapping[str, Sequence[str]]) -> Points:
    """Return the points of the marker sets of a frame; those at the origin are not seen.

    `names` are those of the markers of each set in their order, of the description of the data. A prefix with the name
    of the set, such as ``person_``, is left out where there is one set.
    """
    points: dict[str, Position | None] = {}
    known = [found for found in sets if text(found.model_name) in names]
    for found in known:
        title = text(found.model_name)
        labels = names[title]
        if len(labels) != len(found.marker_pos_list):
            raise ValueError(
                f"{title}: {len(labels)} names of {len(found.marker_pos_list)} markers: they changed in Motive"
            )
        for label, position in zip(labels, found.marker_pos_list, strict=True):
            x, y, z = (float(value) for value in position)
            name = label.removeprefix(f"{title}_")
            if len(known) > 1:
                name = f"{title}_{name}"
            points[name] = None if (x, y, z) == (0.0, 0.0, 0.0) else (x, y, z)
    return points


def names_of(descriptions: Sequence[object]) -> dict[str, list[str]]:
    """Return the names of the markers of each set, from the descriptions of marker sets of NatNet."""
    names = {}
    for described in descriptions:
        title = text(getattr(described, "marker_set_name", ""))
        markers = [text(name) for name in getattr(described, "marker_names_list", ())]
        if title != ALL and markers:
            names[title] = markers
    return names


def frames() -> Iterator[tuple[float, Points]]:
    """Yield frames as they come."""
    from NatNetClient import NatNetClient

    waiting: queue.Queue[object] = queue.Queue(maxsize=2)

    def keep(content: Mapping[str, object]) -> None:
        if not waiting.full():
            waiting.put(content["mocap_data"])

    described: dict[str, list[str]] = {}
    client = NatNetClient()
    client.new_frame_with_data_listener = keep
    client.run("d")
    client.send_request(
        client.command_socket,
        client.NAT_REQUEST_MODELDEF,
        "",
        (client.server_ip_address, client.command_port),
    )
    while True:
        data = waiting.get()
        if not described:
            described = names_of(client.data_descriptions.marker_set_list)
        points = points_of(data.marker_set_data.marker_data_list, described)
        if points:
            yield float(data.suffix_data.timestamp), points


def main(source: Frames | None = None) -> None:
    """Send or record."""
    run(frames() if source is None else source, __doc__)


if __name__ == "__main__":
    main()
