"""Configurations as Pink takes them."""

import numpy as np
import pink


def at(model, q):
    """Make a configuration of a model."""
    return pink.Configuration(model, model.createData(), np.asarray(q, dtype=float))
