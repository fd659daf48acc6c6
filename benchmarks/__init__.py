"""Benchmarks: what maniport does, timed against what one would otherwise use. ``python -m benchmarks`` runs them."""
