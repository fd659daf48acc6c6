"""Public names of the package and its subpackages."""

import importlib

import pytest


@pytest.mark.parametrize("name", ["", ".spd", ".transfer", ".learning", ".motion", ".evaluation", ".mocap", ".arms"])
def test_every_public_name_exists(name):
    """Listed names can be imported, and completion shows them; anything else is an AttributeError."""
    module = importlib.import_module(f"maniport{name}")
    assert set(module.__all__) <= set(dir(module))
    assert all(hasattr(module, name) for name in module.__all__)
    assert not hasattr(module, "no_such_name")
