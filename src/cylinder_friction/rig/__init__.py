"""The simulated test bench: hydraulics, true friction, hand lever, sensors, faults, and campaigns of recordings."""
