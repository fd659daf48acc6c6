"""Errors, how messages name what exists and what was given, and how texts from files are shown."""

import pickle
import subprocess
import sys

import numpy as np
import pytest
from markdown_it import MarkdownIt

from maniport import errors
from maniport.errors import ManiportError, argument, on_the_command_line, unknown_name
from maniport.report import as_markdown
from maniport.report.values import Metric, Report, Section, Table

BUILTINS = {
    errors.InvalidInputError: ValueError,
    errors.NotSPDError: ValueError,
    errors.UnknownNameError: LookupError,
    errors.NotFittedError: AttributeError,
    errors.NotInvertibleError: TypeError,
    errors.FileFormatError: ValueError,
    errors.RecordingError: ValueError,
    errors.OutputError: OSError,
    errors.MissingPackageError: ImportError,
}


def test_errors_are_builtin_errors_and_survive_pickling():
    classes = {
        x for x in vars(errors).values() if isinstance(x, type) and issubclass(x, ManiportError)
    }
    assert classes == {ManiportError, *BUILTINS}
    for error, builtin in BUILTINS.items():
        assert issubclass(error, builtin)
        copy = pickle.loads(pickle.dumps(error("a message")))
        assert (type(copy), str(copy)) == (error, "a message")
    assert issubclass(errors.ConvergenceWarning, UserWarning)


def test_unknown_names_are_answered_with_those_there_are():
    error = unknown_name("frame", "hend", ["base", "hand"], "in 'arm.urdf'")
    assert (
        str(error) == "unknown frame 'hend' in 'arm.urdf'; available, nearest first: 'hand', 'base'"
    )
    message = str(unknown_name("joint", "j", [f"joint{i}" for i in range(30)]))
    assert message.endswith(", and 10 more")
    assert message.count("'joint") == 20


@pytest.mark.parametrize(
    ("name", "value", "called", "typed"),
    [
        ("unit", None, "unit=", "--unit"),
        ("side", "left", "side='left'", "--side left"),
        ("position_tolerance", 5, "position_tolerance=5", "--position-tolerance 5"),
        (
            "markers",
            {"a": ["A"]},
            "markers={'a': ['A']}",
            '--markers markers.json, a file that holds {"a": ["A"]}',
        ),
    ],
)
def test_arguments_are_named_as_they_are_given(name, value, called, typed):
    assert argument(name, value) == called
    with on_the_command_line():
        assert argument(name, value) == typed


ATTACK = "\x1b[2J\x1b]0;title\x07\r\x9b2J\u202e\n"
KINDS = [
    one
    for one in vars(errors).values()
    if isinstance(one, type) and issubclass(one, Warning | ManiportError)
]
HTML = "<img src=x onerror=alert(1)><script>x</script>&lt;b&gt;"
MARKDOWN = (
    "[a](http://evil.example) ![b](http://evil.example/c.png) \\<b> <http://evil.example> | x"
)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_messages_are_printable_and_short(kind):
    message = str(kind(f"arm.urdf: found {ATTACK}, allowed are 'a', 'b'"))
    assert message.isprintable()
    assert message.startswith("arm.urdf: found \\x1b[2J")
    assert message.endswith(", allowed are 'a', 'b'")
    long = kind(f"arm.urdf: found {'x' * 11_000}; allowed is 'y'")
    assert len(str(long)) <= errors.LONGEST_MESSAGE
    assert str(long).endswith("; allowed is 'y'")
    assert str(pickle.loads(pickle.dumps(long))) == str(long)
    assert str(kind("a plain one: ≤ 3°, in 'Datei ä.c3d'")) == "a plain one: ≤ 3°, in 'Datei ä.c3d'"


@pytest.mark.slow
def test_names_from_files_reach_no_terminal_unescaped(tmp_path):
    path = tmp_path / "walk\x1b[2J.npz"
    points = np.broadcast_to([[0.0, 0.0, 1.4], [0.0, 0.0, 1.1], [0.0, 0.0, 0.85]], (9, 3, 3))
    np.savez(path, names=["RSHO", "RELB", f"\x1b[31m{HTML}"], positions=points, rate=10.0, unit="m")
    ended = subprocess.run(
        [sys.executable, "-m", "maniport", "info", str(path)], capture_output=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    assert "RELB" in ended.stdout.decode()
    for line in (ended.stdout + ended.stderr).decode().split("\n"):
        assert line.isprintable()


@pytest.mark.parametrize("attack", [HTML, MARKDOWN, "# heading", "> quotation"])
def test_markdown_shows_names_as_they_are(attack):
    table = Table((attack, "b"), ((attack, "c"),), attack)
    facts = [
        Metric(attack, attack, attack),
        Metric("", attack),
        Metric("", attack, severity="warning"),
    ]
    shown = as_markdown(
        Report(attack, attack, (Section(attack, tuple(facts), (table,)),), *4 * (attack,))
    )
    tokens = [
        token
        for block in MarkdownIt("commonmark").enable("table").parse(shown)
        for token in (block, *(block.children or ()))
    ]
    assert not {token.type for token in tokens} & {
        "html_inline",
        "html_block",
        "link_open",
        "image",
        "blockquote_open",
        "entity",
    }
    headings = [
        tokens[i + 1].children for i, token in enumerate(tokens) if token.type == "heading_open"
    ]
    assert len(headings) == len([1 for line in shown.splitlines() if line.startswith("#")])
    text = "".join(child.content for child in headings[0] if child.type in ("text", "text_special"))
    assert text == attack.rstrip()
