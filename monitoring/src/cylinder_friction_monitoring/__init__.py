"""A fleet each night: indicators of every session, their trends, and alarms that can be believed."""
