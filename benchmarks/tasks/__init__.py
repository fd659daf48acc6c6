"""Task study: what a robot gains from a person's ellipsoids where nothing else states the direction of a task."""
