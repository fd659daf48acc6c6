"""Mutants of `maniport.spd` and `maniport.transfer`, and whether a test notices them."""
