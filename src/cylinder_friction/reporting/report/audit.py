"""The label audit as a table, whatever figures the label stage chose to write."""

from __future__ import annotations

from typing import Any

from cylinder_friction.reporting.comparison_tables import Table

HEADS = {
    "bias_n": "Bias [N]",
    "mae_n": "MAE [N]",
    "mae_percent": "MAE [% of mean |true friction|]",
    "max_n": "Largest [N]",
    "mean_friction_n": "Mean |true friction| [N]",
    "rows": "Rows",
}


def audit_table(audit: Any) -> Table:
    """Return one row for each innermost group of numbers, named by the keys that lead to it.

    Args:
        audit: Nested dictionaries (and lists of them) of numbers and text.
    """
    groups: list[tuple[str, dict[str, Any]]] = []
    _collect(audit, (), groups)
    columns = list(dict.fromkeys(key for _, numbers in groups for key in numbers))
    head = ("", *(HEADS.get(column, column.replace("_", " ")) for column in columns))
    rows = tuple((name or "all", *(_cell(numbers.get(column)) for column in columns)) for name, numbers in groups)
    return Table(head, rows)


def _collect(content: Any, path: tuple[str, ...], groups: list[tuple[str, dict[str, Any]]]) -> None:
    if isinstance(content, list):
        content = {str(index + 1): item for index, item in enumerate(content)}
    if not isinstance(content, dict):
        return
    leaves = {str(key): value for key, value in content.items() if not isinstance(value, dict | list)}
    if leaves:
        groups.append((", ".join(path).replace("_", " "), leaves))
    for key, value in content.items():
        if isinstance(value, dict | list):
            _collect(value, (*path, str(key)), groups)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.2f}" if isinstance(value, float) else str(value)
