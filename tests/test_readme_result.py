"""``make readme`` puts the pipeline's table and picture in place, and nothing else."""

from pathlib import Path

import pytest

from cylinder_friction.commands.readme import BEGIN, END, PICTURES, update_readme


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
