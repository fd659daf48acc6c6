"""Kills at random moments: ``make kills`` tries many."""
