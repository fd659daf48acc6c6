"""Packages that need not be there."""

import json

import pytest

from maniport.errors import MissingPackageError
from maniport.optional import optional_package


def test_a_package_that_is_there_is_imported():
    """What is installed comes as it is."""
    assert optional_package("json", "none", "this") is json


def test_a_missing_package_is_named_with_who_needs_it_and_what_installs_it():
    """The error says what is needed, for what, and how to install it."""
    with pytest.raises(MissingPackageError, match=r"the talk needs no_such_package.*pip install maniport\[talk\]"):
        optional_package("no_such_package", "talk", "the talk")
