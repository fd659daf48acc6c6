"""How things are said."""

import pytest

from maniport import cli
from maniport.errors import argument, on_the_command_line


@pytest.mark.parametrize(
    ("name", "value", "called", "typed"),
    [
        ("unit", None, "unit=", "--unit"),
        ("unit", "mm", "unit='mm'", "--unit mm"),
        ("side", "left", "side='left'", "--arm left"),
        ("tip_tolerance", 5, "tip_tolerance=5", "--tip-tolerance 5"),
        ("markers", {"elbow": ["A"]}, "markers={'elbow': ['A']}",
         '--markers markers.json, a file that holds {"elbow": ["A"]}'),
    ],
)  # fmt: skip
def test_arguments_are_told_in_the_words_of_the_door(name, value, called, typed):
    """Who calls a function reads of its arguments, who types a command of its options."""
    assert argument(name, value) == called
    with on_the_command_line():
        assert argument(name, value) == typed
    assert argument(name, value) == called


def test_the_command_asks_for_its_own_options(monkeypatch, capsys, tmp_path):
    """A file whose unit is not recognised is answered with the option, not with the argument."""
    file = tmp_path / "tail.bvh"
    file.write_text(
        "HIERARCHY\nROOT Tail\n{\nOFFSET 0 0 0\n"
        "CHANNELS 3 Xposition Yposition Zposition\nEnd Site\n{\nOFFSET 0 1 0\n}\n}\n"
        "MOTION\nFrames: 1\nFrame Time: 0.1\n0 0 0\n"
    )
    monkeypatch.setattr("sys.argv", ["maniport", "info", str(file)])
    with pytest.raises(SystemExit):
        cli.main()
    assert "give --unit one of 'm', 'dm'" in capsys.readouterr().err
