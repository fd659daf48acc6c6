"""The whole motion at once, as one nonlinear programme."""
