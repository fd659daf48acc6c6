"""What one is told of a result: facts, figures and pages. Nothing below imports it."""
