"""Where before a robot a hand path lies best."""
