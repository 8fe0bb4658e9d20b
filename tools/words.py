"""Find words in code and documentation that a reader of the field would not know or would misread.

``python tools/words.py [PATH ...]`` prints each place and exits with 1 if there is any; without paths it looks through
``src``, ``docs``, ``conf``, ``performance``, ``README.md``, ``dvc.yaml`` and ``params.yaml``.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

THING = (
    r"(sample|row|recording|column|condition|rig|step|session|task|model|channel|format|direction|input|kind|stage|"
    r"command|seed|file|trial|epoch|node|feature|estimator|family|line|series|second|cylinder|load|page|figure|layer|"
    r"tree|side|run|sensor|idea)"
)
WORDS: dict[str, str] = {
    r"taught|teach(es|ing)?|teachers?|lessons?|pupils?|untaught": "trained, training set, student",
    r"exams?|examined_by|answered|judged?|judges|judging": "evaluation case, job, prediction, validated, scored",
    r"rosters?|participants?": "model registry, model",
    r"(?<!np\.)(?<!math\.)(?<!torch\.)(?<!numpy\.)(?<!std::)floors?(?!\()": "baseline (lower bound in latency)",
    r"programmes?": "benchmark plan; duty cycle on the rig",
    r"plays?": "backlash operator",
    r"sense": "causal velocity, direction of motion",
    r"apart": "in an isolated process; separate",
    r"tracks|even runs?|clock grids?|clock repeats?": "channel timelines, uniform segments, sample grid",
    r"fingerprints?": "duplicate detection; hash",
    r"spoilt|spoils?|nought|what (it|they|the \w+) leaves": "corrupted, zero, residual",
    rf"(one|two|three|\d+|number|value|figure|line|row|column|module|file|estimate|plot|run|entry)s? (a|an) {THING}": "one value per sample",  # noqa: E501
    r"(?-i:Of) (weights|everything|all|the|a|dropout|order|rows|noise)\b(?=[^.]{0,80}(seed|random|order|bootstrap))": "Seeds weights, dropout and batch order",  # noqa: E501
    r"conducting|conducted": "runner",
    r"(?<!study\.)(told|tells?|says?|said)": "given, determines, states",
}
"""Pattern, whole words only, and what to write instead."""

PLACES = ("src", "docs", "conf", "performance", "README.md", "dvc.yaml", "params.yaml")
SUFFIXES = {".py", ".md", ".yaml", ".html", ".j2", ".c", ".h", ".css", ".js"}
_PATTERN = re.compile(
    "|".join(f"(?P<w{index}>(?<![A-Za-z])({word})(?![A-Za-z]))" for index, word in enumerate(WORDS)),
    re.IGNORECASE,
)


def found(path: Path) -> list[str]:
    """Return one line per place in a file: path, line number, the word, and what to write instead."""
    places = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        for match in _PATTERN.finditer(line):
            instead = list(WORDS.values())[int(str(match.lastgroup)[1:])]
            places.append(f"{path}:{number}: {match.group()!r}; write: {instead}")
    return places


def main(paths: list[str]) -> int:
    """Print every place; return 1 if there is one."""
    roots = [Path(path) for path in paths or PLACES if Path(path).exists()]
    files = [file for root in roots for file in ([root] if root.is_file() else sorted(root.rglob("*")))]
    own = [file for file in files if file.suffix in SUFFIXES and ".min" not in file.suffixes]
    places = [place for file in own for place in found(file)]
    sys.stdout.write("".join(f"{place}\n" for place in places) + f"{len(places)} places\n")
    return 1 if places else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
