"""``make readme`` puts the pipeline's table and picture in place, and nothing else."""

from pathlib import Path

import pytest

from cylinder_friction.commands.readme import BEGIN, END, PICTURES, main_rows, update_readme

TABLE = """12 held-out sessions.

Mean absolute error against true friction:

| Estimator | Condition 1 |
|---|---:|
| LuGre (identified in condition 1) | 8.00 % (29.0 N) |
| LuGre, pressure-scaled (identified in condition 1) | 7.79 % (28.2 N) |
| Force balance, tuned low-pass | 2.80 % (10.1 N) |
| Random forest alone | 4.73 % (17.1 N) |
| Hybrid as published | 5.70 % (20.6 N) |
| Hybrid (corrects the force balance) | **1.41 % (5.1 N)** |
| Label itself (off line, looks ahead) | 1.12 % (4.1 N) |

Mean absolute error against the label, which estimators learn from:

| Estimator | Condition 1 |
|---|---:|
| LuGre (identified in condition 1) | 7.84 % (28.4 N) |
"""


@pytest.fixture
def reports(tmp_path: Path) -> Path:
    folder = tmp_path / "reports"
    (folder / "figures").mkdir(parents=True)
    (folder / "table.md").write_text("| new table |\n")
    for picture in PICTURES:
        (folder / "figures" / picture).write_bytes(b"picture")
    return folder


def test_only_what_is_between_the_markers_changes(tmp_path: Path, reports: Path) -> None:
    readme = tmp_path / "README.md"
    readme.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    for _ in range(2):
        update_readme(readme, reports)
        assert readme.read_text() == f"before\n{BEGIN}\n\n| new table |\n\n{END}\nafter\n"
    assert all((tmp_path / target).read_bytes() == b"picture" for target in PICTURES.values())


def test_lost_markers_are_an_error(tmp_path: Path, reports: Path) -> None:
    readme = tmp_path / "README.md"
    readme.write_text("no markers")
    with pytest.raises(ValueError, match="are not both there; put them back"):
        update_readme(readme, reports)
    assert readme.read_text() == "no markers"


def test_the_readme_has_five_rows_against_true_friction() -> None:
    shown = main_rows(TABLE).splitlines()
    assert [line.split(" | ")[0] for line in shown if "%" in line] == [
        "| LuGre (identified in condition 1)",
        "| Force balance, tuned low-pass",
        "| Hybrid as published",
        "| Hybrid (corrects the force balance)",
        "| Label itself (off line, looks ahead)",
    ]
    assert shown[:5] == TABLE.splitlines()[:5]
