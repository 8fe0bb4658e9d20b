"""Labels: friction from the equation of motion, load and mass, the usable rows, and how wrong the label is."""
