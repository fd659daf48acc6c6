"""Readers against mutated files: ``make fuzz``."""
