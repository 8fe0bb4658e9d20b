"""What monitoring refuses."""


class MonitoringError(ValueError):
    """Something that cannot be used; the message states what, where, found, expected and what to do."""
