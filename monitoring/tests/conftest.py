"""The fixtures that many tests share are plugins of pytest."""

import pytest

from cylinder_friction.import_graph import remove_stale_machine_code

pytest_plugins = ("browser", "made_recordings")


def pytest_configure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        remove_stale_machine_code()
