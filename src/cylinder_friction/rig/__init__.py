"""The simulated test bench: hydraulics, true friction, sensors, faults, campaigns."""
