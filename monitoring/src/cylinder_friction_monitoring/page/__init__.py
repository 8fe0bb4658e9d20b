"""The page of a fleet's health, and its figures."""
