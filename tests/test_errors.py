"""Errors, and how messages name what exists and what was given."""

import pickle

import pytest

from maniport import errors
from maniport.errors import ManiportError, argument, on_the_command_line, unknown_name

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
    """Every error is both a `ManiportError` and the builtin that one expects; workers send them as pickles."""
    classes = {x for x in vars(errors).values() if isinstance(x, type) and issubclass(x, ManiportError)}
    assert classes == {ManiportError, *BUILTINS}
    for error, builtin in BUILTINS.items():
        assert issubclass(error, builtin)
        copy = pickle.loads(pickle.dumps(error("a message")))
        assert (type(copy), str(copy)) == (error, "a message")
    assert issubclass(errors.ConvergenceWarning, UserWarning)


def test_unknown_names_are_answered_with_those_there_are():
    error = unknown_name("frame", "hend", ["base", "hand"], "in 'arm.urdf'")
    assert str(error) == "unknown frame 'hend' in 'arm.urdf'; available, nearest first: 'hand', 'base'"
    message = str(unknown_name("joint", "j", [f"joint{i}" for i in range(30)]))
    assert message.endswith(", and 10 more")
    assert message.count("'joint") == 20


@pytest.mark.parametrize(
    ("name", "value", "called", "typed"),
    [
        ("unit", None, "unit=", "--unit"),
        ("side", "left", "side='left'", "--side left"),
        ("position_tolerance", 5, "position_tolerance=5", "--position-tolerance 5"),
        ("markers", {"a": ["A"]}, "markers={'a': ['A']}", '--markers markers.json, a file that holds {"a": ["A"]}'),
    ],
)
def test_arguments_are_named_as_they_are_given(name, value, called, typed):
    assert argument(name, value) == called
    with on_the_command_line():
        assert argument(name, value) == typed
