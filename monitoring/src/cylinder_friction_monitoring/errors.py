"""Errors of monitoring, and logs, sessions or files that a run does not use."""

from cylinder_friction.estimation.results import Quarantined


class MonitoringError(ValueError):
    """An input that cannot be used; the message states what, where, found, expected and what to do."""


Refused = Quarantined
"""A file, a session or a ``piece`` of a file that a run does not use, and why."""
