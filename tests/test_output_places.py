"""Where results are written: symbolic links are followed by files and folders alike; roots and devices are errors."""

import os
import sys

import numpy as np
import pytest

from maniport import cli
from maniport.atomic_io import folder_written_whole
from maniport.errors import OutputError
from maniport.files import save_path
from maniport.telling import Report
from maniport.telling.renderings import write_facts

PATH = np.zeros((2, 3))


def write_folder(target):
    """Write a folder of results."""
    with folder_written_whole(target, ("data",), overwrite=True) as staging:
        (staging / "data").touch()


WRITERS = {
    "arrays": lambda target: save_path(target, PATH),
    "text": lambda target: write_facts(target, Report("A title", "", ())),
    "folder": write_folder,
}


@pytest.fixture(params=WRITERS)
def write(request):
    """One of the ways in which results are written."""
    return WRITERS[request.param]


@pytest.mark.parametrize("earlier", [False, True])
@pytest.mark.parametrize("links", [1, 2])
def test_links_are_followed_and_stay(tmp_path, write, links, earlier):
    """The result is where the link points to, atomically: nothing else is left there, whether there was one before."""
    (tmp_path / "disk").mkdir()
    target = tmp_path / "disk" / "result.md"
    if earlier:
        write(target)
    names = [tmp_path / f"link{i}.md" for i in range(links)]
    for name, pointed in zip(names, ("disk/result.md", *names), strict=False):
        name.symlink_to(pointed)
    write(names[-1])
    assert all(name.is_symlink() for name in names)
    assert target.exists()
    assert not target.is_symlink()
    assert list((tmp_path / "disk").iterdir()) == [target]
    assert sorted(tmp_path.iterdir()) == sorted([tmp_path / "disk", *names])


@pytest.mark.parametrize("pointed", ["missing/result", "loop", "/", "/dev/null", "other"])
def test_links_that_lead_nowhere_are_errors(tmp_path, write, pointed):
    """A link to a folder that is missing, to itself, to the root, a device, or a folder where a file is to be."""
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.tex").touch()
    (tmp_path / "loop").symlink_to(pointed)
    with pytest.raises(OutputError, match="loop"):
        write(tmp_path / "loop")
    assert (tmp_path / "loop").is_symlink()
    assert (tmp_path / "other" / "thesis.tex").exists()


@pytest.mark.parametrize("words", [("demo",), ("transfer", "freeform"), ("learn", "freeform"), ("reproduce",)])
def test_the_root_is_no_place_for_results(monkeypatch, capsys, words):
    """One sentence with exit code 2, before any work."""
    monkeypatch.setattr(sys, "argv", ["maniport", *words, "-o", os.path.abspath(os.sep)])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith("maniport: cannot write '")
