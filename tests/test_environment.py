"""`make demo` and `make test` create their environment on any machine, or name what is missing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SCRIPT = ROOT / "scripts" / "create_environment.sh"
VERSION = "{}.{}".format(*sys.version_info[:2])

WITHOUT_VENV = f"""#!/bin/sh
case "$*" in
    "-m venv"*) mkdir -p .venv/bin; ln -s {sys.executable} .venv/bin/python; echo no ensurepip; exit 1;;
    "-m virtualenv"*) exit 1;;
esac
exec {sys.executable} "$@"
"""
"""As Debian's without the package python3-venv: it leaves an environment without pip."""
OLD = """#!/bin/sh
case "$*" in
    --version) echo Python 3.9.2;;
    *) exit 1;;
esac
"""
WITH_VENV = """#!/bin/sh
case "$*" in
    "-m venv"*) mkdir -p .venv/bin; ln -s "$0" .venv/bin/python; touch .venv/bin/pip; chmod +x .venv/bin/pip;;
    "-m ensurepip"*) touch .venv/bin/pip; chmod +x .venv/bin/pip;;
esac
"""
"""As a Python that can create an environment."""
WITH_PIP = """#!/bin/sh
for folder; do :; done
mkdir -p "$folder/bin"
touch "$folder/bin/pip"
chmod +x "$folder/bin/pip"
printf '#!/bin/sh\\nexit 0\\n' >"$folder/bin/python"
chmod +x "$folder/bin/python"
"""
"""As uv and virtualenv: the last argument is the folder."""


@pytest.fixture
def machine(tmp_path):
    """Return a function that runs the script on a machine with some commands."""
    commands = tmp_path / "commands"
    commands.mkdir()
    for name in ("rm", "mkdir", "ln", "touch", "chmod"):
        (commands / name).symlink_to(shutil.which(name))

    def run(*arguments, **scripts):
        for name, content in scripts.items():
            file = commands / name.replace("_", ".")
            file.write_text(content)
            file.chmod(0o755)
        words = [shutil.which("sh"), str(SCRIPT), ".venv", *arguments]
        return subprocess.run(
            words,
            cwd=tmp_path,
            env={"PATH": str(commands)},
            capture_output=True,
            text=True,
            check=False,
        )

    return run


def has_pip(folder):
    return (folder / ".venv" / "bin" / "pip").exists()


def test_a_python_without_venv_names_the_package(machine, tmp_path):
    """Nothing is left, so that the same command works after the installation."""
    for _ in range(2):
        ended = machine(python3=WITHOUT_VENV)
        assert ended.returncode == 1
        assert f"apt install python{VERSION}-venv" in ended.stderr
        assert not (tmp_path / ".venv").exists()


@pytest.mark.parametrize("other", ["uv", "virtualenv"])
def test_other_tools_are_used_where_venv_is_missing(machine, tmp_path, other):
    ended = machine(python3=WITHOUT_VENV, **{other: WITH_PIP})
    assert (ended.returncode, ended.stderr) == (0, "")
    assert has_pip(tmp_path)


def test_the_first_python_that_is_new_enough_is_taken(machine, tmp_path):
    ended = machine(python3=OLD, python3_12=WITH_VENV)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert os.readlink(tmp_path / ".venv" / "bin" / "python").endswith("python3.12")
    assert has_pip(tmp_path)


def test_an_old_python_is_named(machine, tmp_path):
    for arguments in ((), ("python3",)):
        ended = machine(*arguments, python3=OLD)
        assert ended.returncode == 1
        assert "3.11" in ended.stderr
        assert "3.9.2" in ended.stderr
        assert not (tmp_path / ".venv").exists()


def test_an_environment_without_pip_gets_it_and_others_stay(machine, tmp_path):
    folder = tmp_path / ".venv"
    (folder / "bin").mkdir(parents=True)
    (folder / "bin" / "python").write_text(WITH_VENV)
    (folder / "bin" / "python").chmod(0o755)
    (folder / "mine").touch()
    for _ in range(2):
        assert machine(python3=WITHOUT_VENV).returncode == 0
        assert has_pip(tmp_path)
        assert (folder / "mine").exists()


def test_make_uses_the_script(tmp_path):
    """The environment is created first, then the package is installed there."""
    make = shutil.which("make")
    if make is None:
        pytest.skip("make is not installed")
    words = [make, "--dry-run", f"VENV={tmp_path / 'venv'}", "demo"]
    planned = subprocess.run(
        words, cwd=ROOT, env=dict(os.environ), capture_output=True, text=True, check=True
    ).stdout
    steps = ["create_environment.sh", "pip install", "maniport demo"]
    places = [planned.index(step) for step in steps]
    assert places == sorted(places)
