"""Tasks for Pink: what shall be followed."""
