"""Robot format: JSON with Denavit-Hartenberg rows (θ offset, d, a, α) and joint limits."""

import json

from maniport.arms import READERS, Arm
from maniport.errors import FileFormatError


def read(path, frame=None, joints=None):
    """Read ``{"name": …, "rows": [[θ, d, a, α], …], "lower": [rad], "upper": [rad]}``."""
    try:
        robot = json.loads(path.read_text(encoding="utf-8"))
        chain = Arm.from_dh(robot["name"], robot["rows"], robot["lower"], robot["upper"]).chain
    except (ValueError, KeyError) as error:
        raise FileFormatError(f"{path}: is not a Denavit-Hartenberg table: {error!r}") from None
    return chain


READERS[".json"] = read
