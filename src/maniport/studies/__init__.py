"""Studies that `maniport reproduce` runs."""
