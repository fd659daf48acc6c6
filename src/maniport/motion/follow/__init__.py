"""The control loop: an arm follows ellipsoids, and its tip a path."""
