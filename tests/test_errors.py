"""The tree of errors and the message for unknown names."""

import pickle

import pytest

from maniport import errors
from maniport.errors import ManiportError, ManiportWarning, nearest_first, unknown_name

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


@pytest.mark.parametrize(("error", "builtin"), BUILTINS.items(), ids=lambda x: x.__name__)
def test_errors_are_both_maniport_and_builtin(error, builtin):
    """Every error is caught by `except ManiportError` and by the builtin one expects, and keeps its message."""
    for expected in (ManiportError, builtin):
        with pytest.raises(expected, match=r"^what, where, found, allowed$"):
            raise error("what, where, found, allowed")


@pytest.mark.parametrize("error", BUILTINS, ids=lambda x: x.__name__)
def test_errors_survive_the_way_back_from_a_worker_process(error):
    """An error that is pickled and unpickled has the same class and message."""
    copy = pickle.loads(pickle.dumps(error("a message")))
    assert type(copy) is error
    assert str(copy) == "a message"


def test_every_error_has_its_builtin():
    """No error class is missing from the table above, and warnings are user warnings."""
    classes = [x for x in vars(errors).values() if isinstance(x, type)]
    assert {x for x in classes if issubclass(x, ManiportError)} == {ManiportError, *BUILTINS}
    for warning in (errors.ConvergenceWarning, errors.IdentifiabilityWarning):
        assert issubclass(warning, ManiportWarning)
        assert issubclass(warning, UserWarning)


def test_names_are_sorted_by_likeness():
    """The most similar name comes first whatever its case; ties are alphabetical."""
    assert nearest_first("pandas", ["ur5", "panda", "iiwa"])[0] == "panda"
    assert nearest_first("PANDA", ["ur5", "panda"])[0] == "panda"
    assert nearest_first("x", ["c", "a", "b"]) == ["a", "b", "c"]


def test_unknown_name_lists_what_there_is():
    """The message quotes the name asked for, says where it was looked for and lists the names there are."""
    error = unknown_name("frame", "hend", ["base", "hand"], "in 'arm.urdf'")
    assert str(error) == "unknown frame 'hend' in 'arm.urdf'; there are, nearest first: 'hand', 'base'"
    assert str(unknown_name("robot", "x", [])) == "unknown robot 'x'; there are, nearest first: none"


def test_long_lists_of_names_are_cut():
    """More than twenty names are counted instead of listed."""
    message = str(unknown_name("joint", "j", [f"joint{i}" for i in range(30)]))
    assert message.endswith(", and 10 more")
    assert message.count("'joint") == 20
