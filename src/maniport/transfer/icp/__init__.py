"""The parts of Riemannian ICP."""
