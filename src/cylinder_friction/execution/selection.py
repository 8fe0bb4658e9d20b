"""The choice of workers by the environment variable ``CYLINDER_FRICTION_WORKERS``.

Unset: the caller's choice. ``2``: two processes of one thread each on this machine. ``tcp://host:8786``,
``tls://host:8786`` or a scheduler file: a Dask cluster. It is not a parameter, because it changes the time of the work
and not the result.
"""

import os
import re
from pathlib import Path

from cylinder_friction.execution.workers import VARIABLE, Processes, Workers, WorkersError


def workers_from_environment(default: int = 1, least: int = 0) -> Workers:
    """Choose the workers that ``CYLINDER_FRICTION_WORKERS`` names, to be used in a ``with`` statement.

    Args:
        default: Processes of this machine if the variable is unset; 1: this process alone.
        least: Fewer pieces than this are done in this process, if the variable is unset.

    Raises:
        WorkersError: The variable's value is invalid.
        MissingExtraError: It names a cluster, and Dask is not installed.
    """
    text = os.environ.get(VARIABLE, "").strip()
    if not text:
        return Processes(default, least) if default > 1 else Workers()
    if text.isascii() and text.isdecimal() and int(text) > 0:
        return Processes(int(text)) if int(text) > 1 else Workers()
    if re.fullmatch(r"(tcp|tls)://[^\s/]+:\d+", text) or Path(text).is_file():
        from cylinder_friction.execution.cluster import Cluster  # Dask: only if it is asked for

        return Cluster(text)
    raise WorkersError(
        f"{VARIABLE} is {text!r}; expected a number of processes such as 2, the address of a Dask scheduler such as "
        "tcp://host:8786, or the file that `dask scheduler --scheduler-file` wrote; unset, work is done here"
    )
