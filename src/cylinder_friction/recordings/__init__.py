"""Recordings: what one is, how files become one, how it is checked and stored."""
