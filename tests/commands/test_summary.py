"""The comparison in the width of a terminal."""

from pathlib import Path

import pytest

from cylinder_friction.commands.cli import main

HEAD = (
    r"| Estimator | Condition 1 [% of mean \|true friction\| = 362 N] "
    r"| Condition no-load [% of mean \|true friction\| = 9 N] |"
)
TABLE = rf"""12 held-out sessions. Bold: the smallest error of a condition.

Mean absolute error against true friction:

{HEAD}
|---|---:|---:|
| LuGre, pressure-scaled (identified in condition 1) | 8.00 % (29.0 N) | 18.95 % (79.9 N) |
| Hybrid | **1.41 % (5.1 N)** | **1.68 % (7.1 N)** |
"""


def test_it_fits_a_terminal_and_names_what_to_do_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "reports").mkdir()
    (tmp_path / "reports" / "table.md").write_text(TABLE, encoding="utf-8")
    assert main(["summary"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[:7] == [
        "12 held-out sessions. *: the smallest error of a condition.",
        "",
        "Mean absolute error against true friction [%], by condition:",
        "",
        "Estimator                                              1   no-load",
        "LuGre, pressure-scaled (identified in condition 1)  8.00     18.95",
        "Hybrid                                              1.41*     1.68*",
    ]
    assert any("cylinder-friction live" in line for line in lines)
