"""Properties of public functions for sizes, conditions, units, dtypes and memory orders that hypothesis draws."""
