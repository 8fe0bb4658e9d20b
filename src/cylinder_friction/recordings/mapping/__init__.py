"""From a logger's channels to columns: channel mapping, sensors, units, zeros, and a first mapping by guessing."""
