"""Limits for Pink: what must be kept."""
