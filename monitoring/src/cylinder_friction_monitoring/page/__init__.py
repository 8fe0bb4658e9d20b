"""The pages of a fleet's health: all cylinders on one screen, and one cylinder over its life."""
