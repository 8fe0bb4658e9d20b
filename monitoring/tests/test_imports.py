"""Monitoring uses few public modules of the product, and the product nothing of it."""

import ast
from pathlib import Path

PROJECT = Path(__file__).parents[2]


def imported(folder: Path) -> set[str]:
    """Return the modules that the import statements below a folder name."""
    nodes = [node for path in folder.rglob("*.py") for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))]
    whole = {each.name for node in nodes if isinstance(node, ast.Import) for each in node.names}
    return whole | {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}


def test_monitoring_uses_thirteen_modules_of_the_product_and_the_product_nothing_of_monitoring() -> None:
    used = {name for name in imported(PROJECT / "monitoring/src") if name.partition(".")[0] == "cylinder_friction"}
    assert len(used) <= 13
    assert not {name for name in imported(PROJECT / "src") if name.startswith("cylinder_friction_monitoring")}
    assert "fleet" not in "".join((PROJECT / name).read_text(encoding="utf-8") for name in ("dvc.yaml", "params.yaml"))
