"""Whether the robots of a package are there that some tests look at; not everybody has it."""

import pytest

from maniport.arms.loaders.packages import PACKAGES

HERE = bool(PACKAGES["example-robot-data"].installed())
MISSING = "example-robot-data is not installed"
NEEDS_ROBOTS = pytest.mark.skipif(not HERE, reason=MISSING)
