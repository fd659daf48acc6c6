"""The robot reaches the methods that ask what it can make, and no others."""

import numpy as np
import pytest
from typer.testing import CliRunner

import maniport as mp
from maniport.cli import app
from maniport.util.files import save_ellipsoids


@pytest.fixture(scope="module")
def panda():
    """The Panda."""
    return mp.load_arm("panda")


def test_the_command_line_fits_with_and_without_a_robot(panda, tmp_path):
    """``maniport fit --robot`` asks for what the robot can make, without it the samples are asked for."""
    files = [str(tmp_path / f"{name}.npz") for name in ("teacher", "student", "adapter")]
    save_ellipsoids(files[0], 0.5 * mp.sample_domain(panda, 64, 0))
    save_ellipsoids(files[1], mp.sample_domain(panda, 64, 1))
    asked = {}
    for options in ([], ["--robot", "panda"]):
        command = ["fit", *files[:2], "-o", files[2], "--method", "length-field", "--quiet", *options]
        found = CliRunner().invoke(app, command)
        assert found.exit_code == 0, found.output
        asked[len(options)] = mp.load_adapter(files[2])
    assert asked[0].from_samples_
    assert not asked[2].from_samples_
    assert asked[2].cost_ < asked[0].cost_
    assert np.all(np.isfinite(asked[2].transform(np.eye(3))))
