"""Where a cylinder's files lie in the folder of results."""

RESULTS = "friction"
"""Folder with a folder per cylinder that ``estimate_logs`` writes."""


def session_file(name: str) -> str:
    """Return the path of a cylinder's table of sessions."""
    return f"sessions/{name}.parquet"


def state_file(name: str) -> str:
    """Return the path of what is known of a cylinder."""
    return f"cylinders/{name}.json"


def pane_file(name: str) -> str:
    """Return the path of a cylinder's pane of the page."""
    return f"panes/{name}.js"
