"""Labels: the equation of motion, load, mass, sensor offsets, usable rows, uncertainty."""
