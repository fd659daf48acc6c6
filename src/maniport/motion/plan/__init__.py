"""A motion planned as a whole: what the arm can do at each point, the best way through, and all points at once."""
