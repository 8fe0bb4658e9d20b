"""Thirty hand-made faults, each of which the tests must notice: ``python tools/mutants.py``.

    python tools/mutants.py                 # each fault against the tests beside its module
    python tools/mutants.py --all           # each against everything that `make test` runs
    python tools/mutants.py --look          # none; whether each fault's text is still there, as `make lint` asks
    python tools/mutants.py swapped gate    # those whose names hold one of these words

Each fault is one text in one file, replaced in a copy of the checkout. A fault that no test notices has *survived*.
Returns 1 if more than two survive, or if a text does not stand exactly once in its file.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = Path("src/cylinder_friction")
SURVIVORS = 2
"""So many may survive."""
KILLED, SURVIVED = 1, 0
"""Exit status of pytest: a test failed, none did."""


@dataclass(frozen=True)
class Mutant:
    """A fault: in a file of the package ``old`` is replaced by ``new``; ``tests`` are those that should notice.

    Paths that begin with ``live/`` are those of the live service.
    """

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    @property
    def path(self) -> Path:
        """The file in the checkout."""
        return Path(self.file) if self.file.startswith("live/") else PACKAGE / self.file


def of_the_checkout(test: str) -> str:
    """Return where a test lies in the checkout."""
    return test if test.startswith("live/") else f"tests/{test}"


MUTANTS = (
    # Force balance and geometry
    Mutant(
        "sign of the inertia",
        "labelling/equation_of_motion.py",
        "return force_n - inertia - load_force_n",
        "return force_n + inertia - load_force_n",
        ("labelling",),
    ),
    Mutant(
        "swapped areas",
        "labelling/equation_of_motion.py",
        "signals.pressure_1_smooth_pa * cylinder.piston_area_m2 - signals.pressure_2_smooth_pa * "
        "cylinder.annulus_area_m2",
        "signals.pressure_1_smooth_pa * cylinder.annulus_area_m2 - signals.pressure_2_smooth_pa * "
        "cylinder.piston_area_m2",
        ("labelling",),
    ),
    Mutant(
        "annulus of the difference squared",
        "cylinder.py",
        "(self.bore_diameter_m**2 - self.rod_diameter_m**2)",
        "(self.bore_diameter_m - self.rod_diameter_m) ** 2",
        ("test_cylinder.py",),
    ),
    Mutant(
        "first rows without a whole filter are usable",
        "labelling/label.py",
        "usable[: support.before] = False",
        "usable[: support.before - 1] = False",
        ("labelling",),
    ),
    Mutant(
        "uncertainty of one standard deviation",
        "labelling/uncertainty.py",
        "COVERAGE_FACTOR * np.sqrt(variance)",
        "np.sqrt(variance)",
        ("labelling",),
    ),
    # Units and recordings
    Mutant(
        "a millimetre is a centimetre",
        "recordings/mapping/channel_mapping.py",
        '1e-3: "mm | 毫米 мм", 1e-2: "cm"',
        '1e-2: "cm mm"',
        ("recordings/mapping",),
    ),
    Mutant(
        "absolute pressure read as gauge",
        "recordings/mapping/channel_mapping.py",
        'return "absolute" if match["absolute"] else "gauge"',
        'return "gauge"',
        ("recordings/mapping",),
    ),
    Mutant(
        "validation sessions leak into training",
        "recordings/splits.py",
        "if roles[entry.session] == role))",
        'if roles[entry.session] in (role, "validation" if role == "train" else role)))',
        ("recordings/test_splits.py", "stages/test_split.py"),
    ),
    Mutant(
        "a jump of the clock does not begin another segment",
        "recordings/timeline/channel_timelines.py",
        'segments = np.searchsorted(restarts, np.arange(len(stamps)), side="right")',
        'segments = np.searchsorted(restarts, np.arange(len(stamps)), side="left")',
        ("recordings/timeline",),
    ),
    # Detection of motion
    Mutant(
        "rows behind an event do not count",
        "signals/motion.py",
        "np.minimum(end + after, rows)",
        "np.minimum(end + after - 1, rows)",
        ("signals", "labelling"),
    ),
    # Friction models
    Mutant(
        "ratio of retraction on extension",
        "friction_models/stribeck.py",
        "side = np.where(velocity < 0.0, self.retract_ratio, 1.0)",
        "side = np.where(velocity > 0.0, self.retract_ratio, 1.0)",
        ("friction_models",),
    ),
    Mutant(
        "sign of the bristles' rate",
        "friction_models/lugre.py",
        "stiffness * deflection + damping_per_step[row] * change",
        "stiffness * deflection - damping_per_step[row] * change",
        ("friction_models", "contracts/test_friction_models.py"),
    ),
    # Training and choosing
    Mutant(
        "test recordings used in training",
        "stages/_training.py",
        'role: PROCESSED_FOLDERS[role] for role in ("train", "validation", "calibration")',
        'role: PROCESSED_FOLDERS["test" if role == "validation" else role] '
        'for role in ("train", "validation", "calibration")',
        ("pipeline/test_smoke_pipeline.py",),
    ),
    Mutant(
        "worst final chosen",
        "tuning/finals.py",
        "return min(finals, key=",
        "return max(finals, key=",
        ("tuning",),
    ),
    Mutant(
        "equal candidate promoted",
        "tracking/gate.py",
        "if not new < old:",
        "if not new <= old:",
        ("tracking/test_gate.py",),
    ),
    Mutant(
        "model that was rolled back promoted again",
        "tracking/registry.py",
        "if any(_ROLLED_BACK in each.tags for each in same.values()):",
        "if any(_ROLLED_BACK not in each.tags for each in same.values()):",
        ("tracking/test_registry.py",),
    ),
    Mutant(
        "broken link of lineage not counted",
        "tracking/lineage.py",
        "return all(holds for holds, _ in self.links.values())",
        "return any(holds for holds, _ in self.links.values())",
        ("tracking/test_lineage.py",),
    ),
    # Figures about results
    Mutant(
        "lag off by one sample",
        "evaluation/metrics.py",
        "return (peak - reach + fraction) * sample_time_s",
        "return (peak - reach + 1 + fraction) * sample_time_s",
        ("evaluation",),
    ),
    Mutant(
        "percent of the spread",
        "evaluation/metrics.py",
        "percent=100.0 * _ratio(mae, mean_abs)",
        "percent=100.0 * _ratio(mae, spread)",
        ("evaluation",),
    ),
    # The step in real time
    Mutant(
        "bound too narrow by one error",
        "realtime/bounds.py",
        "rank = math.ceil((len(errors_n) + 1) * side)",
        "rank = math.ceil((len(errors_n) + 1) * side) - 1",
        ("realtime",),
    ),
    Mutant(
        "few sessions do not widen bounds",
        "realtime/bounds.py",
        "return math.sqrt(1.0 + share * (ratio**2 - 1.0))",
        "return 1.0",
        ("realtime",),
    ),
    Mutant(
        "flag OUTSIDE never set in Python",
        "realtime/step.py",
        "flags |= FLAG_OUTSIDE",
        "flags |= 0",
        ("realtime", "contracts/test_runtimes.py"),
    ),
    Mutant(
        "flag RECOVERING never set in C",
        "deployment/c_export/friction.c",
        "flags |= FLAG_RECOVERING;",
        "flags |= 0u;",
        ("contracts/test_runtimes.py",),
    ),
    Mutant(
        "reversals last a sample longer in C",
        "deployment/c_export/friction.c",
        "state->reversal_left = REVERSAL_SAMPLES;",
        "state->reversal_left = REVERSAL_SAMPLES + 1u;",
        ("contracts/test_runtimes.py",),
    ),
    Mutant(
        "range of a known load not cut",
        "realtime/guard.py",
        "max(lowest[place], axis.first_m), min(highest[place], axis.last_m)",
        "min(lowest[place], axis.first_m), max(highest[place], axis.last_m)",
        ("realtime",),
    ),
    # The live service and HTTP
    Mutant(
        "a sample lost behind held ones",
        "live/src/cylinder_friction_live/session.py",
        "behind = after - part.index",
        "behind = after - part.index + 1",
        ("live/tests/test_faults.py", "live/tests/test_service.py"),
    ),
    Mutant(
        "a gap skipped without a reset",
        "live/src/cylinder_friction_live/session.py",
        "yield from self._released(reset=not short)",
        "yield from self._released(reset=False)",
        ("live/tests/test_faults.py", "live/tests/test_service.py"),
    ),
    Mutant(
        "any token is known",
        "live/src/cylinder_friction_live/access.py",
        "return next((role for same, role in known if same), None)",
        "return next((role for same, role in known), None)",
        ("live/tests/test_access.py", "live/tests/test_guard.py"),
    ),
    # Execution and code
    Mutant(
        "files of data do not count as code",
        "import_graph.py",
        "files |= data",
        "files |= set()",
        ("test_import_graph.py",),
    ),
    Mutant(
        "results out of order",
        "execution/workers.py",
        "finished[number] = result\n            while following in finished:",
        "finished[following] = result\n            while following in finished:",
        ("execution",),
    ),
)


def copy_of_the_checkout(folder: Path) -> None:
    """Copy what git tracks, as it stands in the working tree."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout  # noqa: S607
    for name in listed.splitlines():
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    for words in (["init", "--quiet"], ["add", "--all"]):  # some tests ask git what belongs to the project
        subprocess.run(["git", *words], cwd=folder, check=True)  # noqa: S607


def verdict(mutant: Mutant | None, tests: Sequence[str]) -> str:
    """Return ``killed``, ``SURVIVED``, or what kept pytest from running; ``tests`` are all where there are none."""
    with tempfile.TemporaryDirectory(prefix="mutant-") as name:
        folder = Path(name)
        copy_of_the_checkout(folder)  # a fresh one each time: numba's caches do not see changes in other files
        if mutant is not None:
            path = folder / mutant.path
            path.write_text(path.read_text(encoding="utf-8").replace(mutant.old, mutant.new), encoding="utf-8")
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not extended", "-p", "no:cacheprovider"]
        sources = f"{folder / 'src'}{os.pathsep}{folder / 'live/src'}"
        environment = {**os.environ, "PYTHONPATH": sources, "PYTHONDONTWRITEBYTECODE": "1"}
        paths = sorted(map(of_the_checkout, tests), key=lambda path: path.startswith("live/"))
        for _, each in groupby(paths or ["tests"], key=lambda path: path.startswith("live/")):  # each with its settings
            done = subprocess.run([*command, *each], cwd=folder, env=environment, capture_output=True, text=True)
            if done.returncode != SURVIVED:
                break
    if done.returncode == SURVIVED:
        return "SURVIVED"
    if done.returncode == KILLED:
        failed = [line.split(" - ")[0] for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
        return f"killed    {failed[0] if failed else ''}"
    return f"NOT RUN   pytest ended with {done.returncode}: {(done.stdout + done.stderr)[-300:]}"


def misplaced(mutant: Mutant) -> str:
    """Return what is wrong with a mutant's text, if anything."""
    path = ROOT / mutant.path
    gone = [test for test in mutant.tests if not (ROOT / of_the_checkout(test)).exists()]
    if gone:
        return f"{mutant.name}: no such tests: {', '.join(gone)}"
    if not path.is_file():
        return f"{mutant.name}: {path} is not there"
    count = path.read_text(encoding="utf-8").count(mutant.old)
    return "" if count == 1 else f"{mutant.name}: its text stands {count} times in {path}, expected once"


def main() -> int:
    """Print a line per fault, then how many were killed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--all", action="store_true", help="run everything that `make test` runs against each")
    parser.add_argument("--look", action="store_true", help="only look whether each fault's text stands in its file")
    parser.add_argument("words", nargs="*", help="only faults whose names hold one of these words")
    given = parser.parse_args()
    chosen = [each for each in MUTANTS if not given.words or any(word in each.name for word in given.words)]
    wrong = [problem for problem in map(misplaced, chosen) if problem]
    if wrong:
        print("\n".join(wrong))
    if wrong or given.look:
        return int(bool(wrong))
    if not given.words:
        every = [] if given.all else sorted({test for each in chosen for test in each.tests})
        control = verdict(None, every)
        print(f"without a fault: {'no test fails' if control == 'SURVIVED' else control}", flush=True)
        if control != "SURVIVED":
            return 1
    outcomes = []
    for mutant in chosen:
        began_s = time.monotonic()
        outcomes.append(verdict(mutant, () if given.all else mutant.tests))
        print(f"{mutant.name:52} {time.monotonic() - began_s:5.0f} s  {outcomes[-1]}", flush=True)
    killed = sum(each.startswith("killed") for each in outcomes)
    print(f"{killed} of {len(chosen)} killed")
    return int(len(chosen) - killed > SURVIVORS)


if __name__ == "__main__":
    sys.exit(main())
