"""Stage ``monitor``: the nightly run over a fleet's logs, with its page, tables and answers."""

from __future__ import annotations

from collections import Counter
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from tqdm import tqdm

from cylinder_friction.execution.selection import workers_from_environment
from cylinder_friction.fleet.nightly import HEALTH_FILE, PAGE_FILE, monitor_fleet
from cylinder_friction.params.file import ParamsError
from cylinder_friction.params.fleet import REGISTERED, load_fleet
from cylinder_friction.run_record import RunRecord, by_columns
from cylinder_friction.stages._stage import REPORTS_FOLDER, artifacts, flat

if TYPE_CHECKING:
    from cylinder_friction.params.checking import Params

HEALTH_FOLDER = REPORTS_FOLDER / "health"


def run(params: Params) -> RunRecord:
    """Bring ``reports/health`` up to the logs that the parameters name.

    Raises:
        ParamsError: The parameters name no fleet, or its file names a registered model.
    """
    plan = params.monitor.fleet
    if plan is None:
        raise ParamsError("monitor: names no fleet; compose the parameters with monitor=fleet or experiment=fleet")
    fleet = load_fleet(Path(plan.file))
    if registered := [name for name, each in fleet.cylinders.items() if each.model.startswith(REGISTERED)]:
        raise ParamsError(
            f"{plan.file}: {registered[0]} has the model {fleet.cylinders[registered[0]].model}, expected a folder; "
            "a registered model changes unseen by DVC: run `cylinder-friction monitor` for it"
        )
    with workers_from_environment() as workers:
        health = monitor_fleet([plan.logs], fleet, HEALTH_FOLDER, datetime.now(UTC), workers)
    for line in health.lines:
        tqdm.write(f"monitor: {line.cylinder}: {line.answer}: {line.words}{line.look and f' Look: {line.look}.'}")
    health.announced()
    answers = Counter(line.answer.replace(" ", "_") for line in health.lines)
    return RunRecord(
        name="monitor",
        params=flat(plan),
        metrics={
            "cylinders": float(len(health.lines)),
            "sessions": float(sum(line.sessions for line in health.lines)),
            "refused": float(len(health.refused)),
            **{f"answers/{answer}": float(count) for answer, count in answers.items()},
        },
        tables={
            "answers": by_columns(
                {name: getattr(line, name) for name in ("cylinder", "answer", "headline", "words", "look")}
                for line in health.lines
            )
        },
        artifacts=artifacts(*(HEALTH_FOLDER / name for name in (PAGE_FILE, HEALTH_FILE, "panes"))),
    )
