"""Where before a robot a path lies best."""
