"""Monitor a fleet every night: indicators of every session, their trends, and alarms with a known false alarm rate."""
