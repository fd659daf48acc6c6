"""The paper's experiments again, and the comparison of the methods on human motions."""
