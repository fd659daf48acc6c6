"""Validation, files, progress, optional packages and other helpers without knowledge of the domain."""
