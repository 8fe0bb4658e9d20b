"""When a seal wears: indicators of sessions, their trends, and alarms that can be believed."""
