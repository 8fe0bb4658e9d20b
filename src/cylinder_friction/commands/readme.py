"""The command ``readme``: put the pipeline's latest numbers and picture into ``README.md`` and the guide on serving."""

import argparse
import json
import re
from pathlib import Path

import pandas as pd

from cylinder_friction.deployment.scoring import ServedModel, score_frame
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.evaluation.comparison import LABEL_ITSELF
from cylinder_friction.files.whole_files import write_bytes, write_text
from cylinder_friction.reporting.estimator_titles import title
from cylinder_friction.run_record import records_in

BEGIN, END = "<!-- result: begin (make readme) -->", "<!-- result: end -->"
EXPECTED = (ValueError, OSError)
SERVING, MODEL = Path("docs/serving.md"), Path("models/hybrid")
JSON_BLOCK = re.compile(r"(?<=^```json\n).*?(?=\n^```$)", re.MULTILINE | re.DOTALL)
PICTURES = {"figure6_friction_over_time.png": "docs/images/friction_over_time.png"}


_ROWS = ("lugre", "force_balance_low_pass", "paper_hybrid", "hybrid", LABEL_ITSELF)
"""The estimators that the README shows; the report has all."""


def update_readme(readme: Path, reports: Path) -> None:
    """Put the main rows of ``reports/table.md`` between the markers, and the pictures into ``docs/images``.

    Raises:
        FileNotFoundError: The pipeline has not run.
        ValueError: The README has lost its markers.
    """
    table = reports / "table.md"
    if not table.is_file():
        raise FileNotFoundError(f"{table.absolute()}: not there; run `dvc repro` first")
    text = readme.read_text(encoding="utf-8")
    if BEGIN not in text or END not in text:
        raise ValueError(f"{readme}: the markers {BEGIN!r} and {END!r} are not both there; put them back")
    for source, target in PICTURES.items():
        write_bytes(readme.parent / target, (reports / "figures" / source).read_bytes())
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    write_text(readme, f"{before}{BEGIN}\n\n{main_rows(table.read_text(encoding='utf-8'))}\n\n{END}{after}")


def main_rows(markdown: str) -> str:
    """Shorten the tables of a comparison to the first one, which is against true friction if that is known."""
    lines: list[str] = []
    begun = False
    for line in markdown.strip().splitlines():
        if begun and not line.startswith("|"):
            break
        if not begun or line.startswith("|---") or any(line.startswith(f"| {title(name)} ") for name in _ROWS):
            lines.append(line)
        begun = begun or line.startswith("|")
    return "\n".join(lines)


def update_answer(guide: Path, model: Path) -> None:
    """Put a model's answer to the request of the guide on serving, its first JSON block, into the second one."""
    text = guide.read_text(encoding="utf-8")
    request, answer = list(JSON_BLOCK.finditer(text))[:2]
    rows = ",\n".join(f"  {json.dumps(row)}" for row in score_request(request[0], model))
    lines = rows.replace(', "flags"', ',\n   "flags"')
    write_text(guide, f'{text[: answer.start()]}{{"predictions": [\n{lines}]}}{text[answer.end() :]}')


def score_request(request: str, model: Path) -> list[dict[str, object]]:
    """Score a request (``dataframe_split``) as the served model does, with two decimals."""
    rows = pd.DataFrame(**json.loads(request)["dataframe_split"])
    scored = score_frame(ServedModel(load_estimator(model).step_model()), rows).round(2)
    return [{str(name): value for name, value in row.items()} for row in scored.to_dict("records")]


def run(_options: argparse.Namespace) -> None:
    update_readme(Path("README.md"), Path("reports"))
    if SERVING.is_file():
        update_answer(SERVING, MODEL)
    compared = records_in(Path()).get("compare")
    if compared is not None and compared.experiment:
        print(
            f"README.md now shows the recipe {compared.experiment!r}, not the default; if that is not what you meant, "
            "run `make params`, `dvc repro` and this command again"
        )
