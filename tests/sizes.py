"""Sizes of what tests work on."""

SMALL = {"n_teacher": 128, "n_student": 256}
"""Sizes of domains for tests in which the way matters, and not how good the figures are."""
