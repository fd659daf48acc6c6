"""Costs of configurations: each has residuals, whose squares are summed, and their derivatives."""
