"""Methods, readers and costs of an installed package work from the command line, also in workers."""

import os
import shutil
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import maniport as mp
from maniport.cli import app
from maniport.mocap import READERS
from maniport.pipeline import extensions
from maniport.pipeline.options import OPTIONS
from maniport.transfer import METHODS
from maniport.util.files import save_ellipsoids, save_path
from sizes import little_search, panda_profile

HERE = Path(__file__).parent
SMALL = (
    *("--start", "10.7", "--stop", "11", "--n-teacher", "64", "--n-student", "256"),
    *("--no-collisions", "--speed-scale", "0.5", "--rate", "100"),
)
POINTS = """[maniport.methods]
shift = our_lab.log_euclidean_shift:LogEuclideanShift

[maniport.readers]
.pts = our_lab.table_reader:read

[maniport.costs]
low_elbow = our_lab:low_elbow
"""
FAULTS = """[maniport.methods]
gone = our_lab.nowhere:Method
icp = our_lab.log_euclidean_shift:LogEuclideanShift
number = our_lab:NUMBER

[maniport.readers]
pts = our_lab.table_reader:read
.bvh = our_lab.table_reader:read

[maniport.costs]
number = our_lab:NUMBER
text = our_lab:text
"""
MODULE = '''"""Extensions of a laboratory."""

from our_lab.height_cost import HeightCost

NUMBER = 3


def low_elbow(robot):
    """Hold the elbow low."""
    return HeightCost(robot, "panda_link4", 0.2, 50.0)


def text(robot):
    """Make no cost."""
    return "high"
'''


def installed(folder, points):
    """Install a package in a folder: its modules and the metadata that name its entry points."""
    package = folder / "our_lab"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text(MODULE)
    for name in ("log_euclidean_shift", "table_reader", "height_cost"):
        source = (HERE.parent / "extensions" / f"{name}.py").read_text(encoding="utf-8")
        source = source.replace('READERS[".pts"] = read', "")
        (package / f"{name}.py").write_text(source, encoding="utf-8")
    about = folder / "our_lab-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: our-lab\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(points)
    return folder


@pytest.fixture
def site(tmp_path, monkeypatch):
    """Return a function that installs the package for this test alone."""
    registries = (METHODS, READERS, extensions.COSTS, OPTIONS)
    before = [dict(registry) for registry in registries]
    monkeypatch.setattr(extensions, "_loaded", set())

    def install(points):
        monkeypatch.syspath_prepend(installed(tmp_path / "site", points))

    yield install
    for registry, content in zip(registries, before, strict=True):
        registry.clear()
        registry.update(content)
    for name in [name for name in sys.modules if name.partition(".")[0] == "our_lab"]:
        del sys.modules[name]


def run(*words):
    with little_search():
        done = CliRunner().invoke(app, [*map(str, words)])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        return 2, done.stdout, f"{done.stderr}{done.exception}"
    return done.exit_code, done.stdout, done.stderr


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """The ladder recording in a format that only the package reads."""
    folder = tmp_path_factory.mktemp("recordings")
    part = mp.read_recording("ladder").crop(10.5, 11.2)
    header = ["time", *(f"{name}.{axis}" for name in part.names for axis in "xyz")]
    table = np.column_stack([part.time, part.positions.reshape(len(part), -1)])
    np.savetxt(folder / "ladder.pts", table, header=" ".join(header), comments="")
    return folder / "ladder.pts"


def test_a_transfer_by_a_method_from_a_format_of_the_package(recording, site, tmp_path):
    site(POINTS)
    words = ("transfer", recording, "--method", "shift", *SMALL, "--no-move")
    code, _, err = run(*words, "-o", tmp_path / "out")
    assert code == 0, err
    settings = yaml.safe_load((tmp_path / "out" / "run.yaml").read_text())
    assert settings["transfer"]["method"] == "shift"
    adapter = mp.load_adapter(tmp_path / "out" / "adapter.npz")
    assert type(adapter).__name__ == "LogEuclideanShift"


def test_a_cost_of_the_package(site, tmp_path):
    site(POINTS)
    _, time, _, ellipsoids, path = panda_profile(5)
    save_ellipsoids(tmp_path / "profile.npz", ellipsoids, time)
    save_path(tmp_path / "path.npz", path, time)
    options = ("--path", tmp_path / "path.npz", "--no-collisions", "--rate", "100", "-q")
    words = ("track", tmp_path / "profile.npz", *options)
    code, _, err = run(*words, "--costs", "low_elbow", "-o", tmp_path / "low")
    assert code == 0, err
    settings = yaml.safe_load((tmp_path / "low" / "run.yaml").read_text())
    assert settings["motion"]["costs"] == ["low_elbow"]
    code, _, err = run(*words, "-o", tmp_path / "free")
    assert code == 0, err
    panda = mp.load_arm("panda")
    heights = []
    for name in ("low", "free"):
        with np.load(tmp_path / name / "joints.npz") as joints:
            points = panda.point_positions(joints["joint_positions"], ["panda_link4"])
        heights.append(np.abs(points[:, 0, 2] - 0.2).mean())
    assert heights[0] < heights[1] - 1e-3


def test_workers_of_a_batch(recording, site, tmp_path):
    site(POINTS)
    (tmp_path / "recordings").mkdir()
    for name in ("one.pts", "two.pts"):
        shutil.copy(recording, tmp_path / "recordings" / name)
    words = ("batch", tmp_path / "recordings", "--method", "shift", "--processes", "2", *SMALL)
    code, _, err = run(*words, "--no-move", "-o", tmp_path / "out")
    assert code == 0, err
    found = {file.parent.name for file in (tmp_path / "out").rglob("target_profile.npz")}
    assert found == {"one.pts", "two.pts"}


def test_faulty_ones_are_named_and_do_no_harm(site, tmp_path):
    site(FAULTS)
    code, out, err = run("info", "panda")
    assert code == 0
    assert "panda_joint1" in out
    for name in ("'gone'", "'icp'", "'number'", "'pts'", "'.bvh'"):
        assert name in err
    assert err.count("our-lab") == 6
    assert "Traceback" not in err
    assert run("info", "panda")[2] == ""  # once

    code, _, err = run("transfer", "ladder", "--costs", "text", *SMALL, "-o", tmp_path / "out")
    assert code == 2
    assert "'text'" in err
    assert not (tmp_path / "out").exists()


def test_a_cost_that_is_not_installed(site, tmp_path):
    code, _, err = run("transfer", "ladder", "--costs", "low_elbow", *SMALL, "-o", tmp_path / "out")
    assert code == 2
    assert "low_elbow" in err


def test_a_new_process_finds_the_package(recording, tmp_path):
    folder = installed(tmp_path / "site", POINTS)
    path = os.pathsep.join([str(folder), *(entry for entry in sys.path if entry)])
    done = subprocess.run(
        [sys.executable, "-m", "maniport", "info", str(recording)],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "ladder.pts" in done.stdout


def wheel(folder, points):
    """Build the package as a wheel."""
    contents = installed(folder / "content", points)
    about = contents / "our_lab-1.0.dist-info"
    (about / "WHEEL").write_text("Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
    files = sorted(file for file in contents.rglob("*") if file.is_file())
    names = [file.relative_to(contents).as_posix() for file in files]
    record = "".join(f"{name},,\n" for name in [*names, "our_lab-1.0.dist-info/RECORD"])
    path = folder / "our_lab-1.0-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for file, name in zip(files, names, strict=True):
            archive.write(file, name)
        archive.writestr("our_lab-1.0.dist-info/RECORD", record)
    return path


@pytest.mark.slow
def test_a_package_that_pip_installs_into_an_environment(recording, tmp_path):
    """The environment has maniport from this one; the package is installed by pip."""
    venv.create(tmp_path / "env", with_pip=False)
    python = tmp_path / "env" / "bin" / "python"
    (site_packages,) = (tmp_path / "env" / "lib").glob("python*/site-packages")
    here = [entry for entry in sys.path if entry.endswith("site-packages")]
    lines = "".join(f"import site; site.addsitedir({entry!r})\n" for entry in here)
    (site_packages / "here.pth").write_text(lines)
    package = wheel(tmp_path, POINTS)
    install = ("install", "--quiet", "--no-index", "--no-deps", "--disable-pip-version-check")
    subprocess.run(
        [sys.executable, "-m", "pip", "--python", python, *install, package],
        check=True,
        capture_output=True,
    )
    assert (site_packages / "our_lab").is_dir()
    words = ("transfer", recording, "--method", "shift", "--quiet", "-o", tmp_path / "out")
    source = str(Path(mp.__file__).parents[1])
    done = subprocess.run(
        [python, "-m", "maniport", *words, *SMALL, "--no-move"],
        env={**os.environ, "PYTHONPATH": source},
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    settings = yaml.safe_load((tmp_path / "out" / "run.yaml").read_text())
    assert settings["transfer"]["method"] == "shift"
    assert settings["recording"] == [str(recording)]
