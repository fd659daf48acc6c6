"""Two arms at once: placed, planned, timed and followed together."""
