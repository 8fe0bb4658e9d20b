"""Friction as a function of motion, and the identification of such models from labels."""
