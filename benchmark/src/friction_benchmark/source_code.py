"""The code that a result depends on: modules of the benchmark and of the product."""

from pathlib import Path

from cylinder_friction import import_graph

PACKAGES = {**import_graph.PACKAGES, "friction_benchmark": Path(__file__).parents[1]}


def code_key(*modules: str) -> str:
    """Return a hash over every file that decides what these modules do."""
    return import_graph.code_key(*modules, packages=PACKAGES)
