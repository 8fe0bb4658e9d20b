"""When a seal wears: indicators of sessions, their trend, and alarms that can be believed."""
