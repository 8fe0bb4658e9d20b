"""The README's table and picture: the default's alone, and whole or not at all."""

from __future__ import annotations

import json
import resource
import shutil
from pathlib import Path

import pytest

from cylinder_friction.commands.cli import main
from cylinder_friction.commands.readme import (
    BEGIN,
    END,
    JSON_BLOCK,
    MODEL,
    PICTURES,
    SERVING,
    main_rows,
    score_request,
    update_answer,
    update_readme,
)
from cylinder_friction.run_record import RunRecord

ROOT = Path(__file__).parents[2]
LEARNS_OFFSET = ROOT / "tests/golden/learns_offset/model"
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
PICTURE = Path(next(iter(PICTURES.values())))


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project whose README shows earlier results, and new results beside it."""
    (tmp_path / "reports/figures").mkdir(parents=True)
    (tmp_path / "reports/runs").mkdir()
    (tmp_path / "reports/table.md").write_text("| Hybrid | 1.41 % |\n", encoding="utf-8")
    for source, target in PICTURES.items():
        (tmp_path / "reports/figures" / source).write_bytes(b"new" * 30_000)
        (tmp_path / target).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / target).write_bytes(b"old")
    (tmp_path / "README.md").write_text(f"# Title\n{BEGIN}\nold\n{END}\nrest\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def of_recipe(root: Path, experiment: str) -> None:
    record = RunRecord("compare", experiment=experiment)
    (root / "reports/runs/compare.json").write_text(json.dumps(record.to_dict()), encoding="utf-8")


def test_the_default_recipe_is_shown_without_a_word(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    of_recipe(project, "")
    for _ in range(2):
        assert main(["readme"]) == 0
        assert capsys.readouterr().out == ""
        assert (project / "README.md").read_text(encoding="utf-8") == (
            f"# Title\n{BEGIN}\n\n| Hybrid | 1.41 % |\n\n{END}\nrest\n"
        )
        assert all((project / target).read_bytes() == b"new" * 30_000 for target in PICTURES.values())


def test_lost_markers_are_an_error(project: Path) -> None:
    (project / "README.md").write_text("no markers")
    with pytest.raises(ValueError, match="are not both there; put them back"):
        update_readme(project / "README.md", project / "reports")
    assert (project / "README.md").read_text() == "no markers"


def test_another_recipe_is_named(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    of_recipe(project, "smoke")
    assert main(["readme"]) == 0
    printed = capsys.readouterr().out
    assert "README.md now shows the recipe 'smoke', not the default" in printed
    assert "run `make params`, `dvc repro` and this command again" in printed


def test_a_full_disk_leaves_the_earlier_picture_and_table(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, hard))  # of bytes in a file: as if the disk were full then
    try:
        status = main(["readme"])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert status == 1
    assert "File too large" in capsys.readouterr().err
    assert (project / PICTURE).read_bytes() == b"old"
    assert "old" in (project / "README.md").read_text(encoding="utf-8")
    assert [path.name for path in (project / PICTURE).parent.iterdir()] == [PICTURE.name], "no draft stays"


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


def printed(guide: Path) -> tuple[str, list[dict[str, object]]]:
    """Return the request that the guide on serving prints, and the rows of the answer."""
    request, answer, *_ = JSON_BLOCK.findall(guide.read_text(encoding="utf-8"))
    return request, json.loads(answer)["predictions"]


def test_the_answer_in_the_guide_becomes_that_of_the_model(tmp_path: Path) -> None:
    guide = Path(shutil.copy(ROOT / SERVING, tmp_path))
    for _ in range(2):
        update_answer(guide, LEARNS_OFFSET)
        assert printed(guide) == (printed(ROOT / SERVING)[0], score_request(printed(guide)[0], LEARNS_OFFSET))
    before, after = (JSON_BLOCK.sub("", each.read_text(encoding="utf-8")) for each in (ROOT / SERVING, guide))
    assert before == after


def test_the_printed_answer_has_the_fields_and_flags_of_a_served_model() -> None:
    request, rows = printed(ROOT / SERVING)
    expected = score_request(request, LEARNS_OFFSET)
    assert [(list(row), row["flag_names"]) for row in rows] == [(list(row), row["flag_names"]) for row in expected]


@pytest.mark.skipif(not (ROOT / MODEL / "estimator.json").is_file(), reason="the pipeline has not run here")
def test_the_printed_answer_is_that_of_the_pipelines_model() -> None:
    request, rows = printed(ROOT / SERVING)
    for row, expected in zip(rows, score_request(request, ROOT / MODEL), strict=True):
        assert row["flag_names"] == expected["flag_names"], "run `make readme`"
        assert row["friction_n"] == pytest.approx(expected["friction_n"], abs=5.0), "run `make readme`"
