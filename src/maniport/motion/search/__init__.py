"""Joint positions for ellipsoids: samples to begin from, and the descent from them."""
