"""Packages that need not be there."""

import json
import sys

import numpy as np
import pytest

import maniport as mp
from maniport.errors import MissingPackageError
from maniport.optional import optional_package


def test_a_package_that_is_there_is_imported():
    """What is installed comes as it is."""
    assert optional_package("json", "none", "this") is json


def test_a_missing_package_is_named_with_who_needs_it_and_what_installs_it():
    """The error says what is needed, for what, and how to install it."""
    with pytest.raises(MissingPackageError, match=r"the talk needs no_such_package.*pip install maniport\[talk\]"):
        optional_package("no_such_package", "talk", "the talk")


def test_optimal_transport_is_asked_for_where_it_is_chosen(monkeypatch):
    """Only the correspondence of that name needs POT, and says how to install it."""
    monkeypatch.setitem(sys.modules, "ot", None)
    domain = np.eye(3) * np.arange(1.0, 9.0)[:, None, None] + np.diag([0.0, 1.0, 2.0])
    mp.RiemannianICP(random_state=0).fit(domain, 2.0 * domain)
    with pytest.raises(MissingPackageError, match=r"'transport' needs ot.*pip install maniport\[transport\]"):
        mp.RiemannianICP(correspondence="transport", random_state=0).fit(domain, 2.0 * domain)
