"""Monitoring uses few public modules of the product, and the product nothing of it."""

import ast
from pathlib import Path

PROJECT = Path(__file__).parents[2]
PUBLIC = {
    "cylinder_friction",
    "cylinder_friction.estimation.kept_results",
    "cylinder_friction.recordings.columns",
    "cylinder_friction.files.whole_files",
    "cylinder_friction.files.locks",
    "cylinder_friction.recordings.reading_logs",
    "cylinder_friction.recordings.result_folder",
    "cylinder_friction.reporting.frame",
    "cylinder_friction.rig.bench",
    "cylinder_friction.signals.motion",
    "cylinder_friction.tracking.model_folder",
    "cylinder_friction.tracking.store",
}


def imported(folder: Path) -> set[str]:
    """Return the modules that the import statements below a folder name."""
    found = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                found.add(node.module or "")
            elif isinstance(node, ast.Import):
                found |= {each.name for each in node.names}
    return found


def test_monitoring_uses_twelve_modules_of_the_product() -> None:
    used = {name for name in imported(PROJECT / "monitoring/src") if name.partition(".")[0] == "cylinder_friction"}
    assert used == PUBLIC
    assert len(PUBLIC) <= 12


def test_the_product_knows_nothing_of_monitoring() -> None:
    assert not {name for name in imported(PROJECT / "src") if name.startswith("cylinder_friction_monitoring")}
    text = "".join((PROJECT / name).read_text(encoding="utf-8") for name in ("dvc.yaml", "params.yaml"))
    assert "fleet" not in text
