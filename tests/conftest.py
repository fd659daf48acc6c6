"""Settings for every test: property-based tests draw the same examples on every machine and have no deadline."""

from hypothesis import settings

settings.register_profile("maniport", derandomize=True, deadline=None, max_examples=15)
settings.load_profile("maniport")
