"""One cylinder's part of a run: process its new logs, then assess it and write its files."""

import hashlib
import json
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any

from cylinder_friction import Recording, estimate_logs, load
from cylinder_friction.estimation.results import OtherCylinderError, kept_recordings, made_with_model, restore_summary
from cylinder_friction.files.whole_files import read_json, write_json, write_text
from cylinder_friction.recordings.columns import LOAD_FORCE
from cylinder_friction.recordings.logs import load_settings
from cylinder_friction_monitoring.errors import Refused
from cylinder_friction_monitoring.fleet.doubts import doubts, too_late
from cylinder_friction_monitoring.fleet.files import RESULTS, pane_file, read_or_name, session_file, state_file
from cylinder_friction_monitoring.fleet.plan import Dimensions, FleetCylinder
from cylinder_friction_monitoring.fleet.sessions import (
    KeptRow,
    read_rows,
    stated_start,
    updated_rows,
    with_starts,
    write_rows,
)
from cylinder_friction_monitoring.page.health_page import health_pane
from cylinder_friction_monitoring.trends.assessment import Assessment, Entry, ModelBounds
from cylinder_friction_monitoring.trends.cylinder_line import LOOK, CylinderLine, Trend, line_of
from cylinder_friction_monitoring.trends.held_label import held_label
from cylinder_friction_monitoring.trends.in_force import in_force
from cylinder_friction_monitoring.trends.indicators import session_row
from cylinder_friction_monitoring.trends.session_row import SessionRow
from cylinder_friction_monitoring.trends.verdict import assess

ASSESSED_ANEW = "the cylinder is assessed anew"
COMPUTED_ANEW = "its sessions are computed anew from the friction that is kept"


@dataclass(frozen=True)
class Taken:
    """The outcome of reading a cylinder's logs."""

    refused: tuple[Refused, ...] = ()
    notes: tuple[str, ...] = ()
    # Session of each log by SHA-256, and whether this run was given the log
    logs: Mapping[str, tuple[str, bool]] = field(default_factory=dict)


@dataclass(frozen=True)
class Known:
    """A cylinder's assessment in one line, and what is new about the cylinder."""

    line: CylinderLine
    left_out: Mapping[str, str] = field(default_factory=dict)  # Why sessions are not assessed
    failed: Mapping[str, str] = field(default_factory=dict)  # Why sessions have no row
    news: tuple[str, ...] = ()
    damaged: tuple[Refused, ...] = ()  # Damaged files of the run before


@dataclass(frozen=True)
class Earlier:
    """The assessment of the run before."""

    line: CylinderLine
    dimensions: Mapping[str, float]
    late: Sequence[str]  # Sessions that came too late to be assessed
    proposed: bool  # Whether it proposed retraining

    @classmethod
    def read(cls, path: Path) -> "Earlier":
        about = read_json(path)
        line = CylinderLine(**{**about["line"], "trend": Trend(**about["line"]["trend"])})
        model = about["assessment"]["model"] or {}
        dimensions, proposed = asdict(Dimensions(**about["dimensions"])), model.get("proposed", False)
        return cls(line, dimensions, about.get("late", ()), proposed)


@dataclass(frozen=True)
class CylinderRun:
    """A cylinder in a run."""

    name: str
    owned: FleetCylinder
    into: Path  # The folder of results as the run before left it
    root: Path  # Names of logs are relative to it
    code: str  # SHA-256 of the code
    now: datetime

    @property
    def results(self) -> Path:
        return self.into / RESULTS / self.name

    @cached_property
    def stated(self) -> float | None:
        """The share of the label that its model's bounds should contain; None without a model or its bounds."""
        bounds = load(self.owned.model).bounds if self.owned.model else None
        return None if bounds is None else bounds.probability

    @property
    def made_by(self) -> str:
        """Code, settings and model that the rows of its sessions are made with."""
        return f"{self.code} {self.owned.indicator_plan('none')} {made_with_model(self.results)}"

    def taken(self, files: Sequence[Path], any_logs: bool) -> Taken:
        """Process the new logs among ``files``. ``any_logs`` is false if the run reads no logs of any cylinder."""
        refused, notes = list[Refused](), list[str]()
        if problem := restore_summary(self.results):
            words = f"is damaged ({problem}); it was made anew from the results beside it"
            refused.append(Refused(f"{RESULTS}/{self.name}/summary.json", words))
        if files:
            try:
                with warnings.catch_warnings(record=True) as caught:
                    warnings.simplefilter("always", UserWarning)
                    found = estimate_logs(
                        files,
                        self.owned.cylinder(self.name),
                        self.results,
                        channels=self._channels(),
                        model=self.owned.model or None,
                        load=self.owned.load,
                        names=self.owned.names,
                        units=self.owned.units,
                        sensor_class=self.owned.sensor_class,
                    )
                notes += [f"{self.name}: {each.message}" for each in caught]
                refused += [Refused(f"{self.name}: {each.file}", each.reason, each.piece) for each in found.refused]
            except OtherCylinderError as error:
                other = str(error).partition(";")[0]
                refused.append(Refused(self.name, f"{other}; correct `model` or `dimensions` in fleet.yaml"))
            except (ValueError, OSError) as error:
                refused.append(Refused(self.name, f"none of its {len(files)} logs was taken: {error}"))
        logs = {
            each["source_sha256"]: (session, not any_logs or bool(files and not each["gone"]))
            for session, recordings in kept_recordings(self.results).items()
            for each in recordings
        }
        return Taken(tuple(refused), tuple(notes), logs)

    def known(self, draft: Path, entries: Sequence[Entry], foreign: Mapping[str, str]) -> Known:
        """Assess the cylinder if anything is new about it, and write its files into the folder ``draft``.

        ``foreign`` states by session that its log belongs to another cylinder.
        """
        damaged, nothing = list[Refused](), dict[str, KeptRow]()
        earlier = read_or_name(self.into, state_file(self.name), Earlier.read, None, ASSESSED_ANEW, damaged)
        found_rows = read_or_name(self.into, session_file(self.name), read_rows, nothing, COMPUTED_ANEW, damaged)
        rows, failed = updated_rows(self.results, found_rows, self._row, self.made_by)
        kept = found_rows or (rows if earlier or damaged else {})  # without the table, new sessions cannot be found
        failed |= _unknown_starts(self.owned.starts, [*rows, *failed])
        placed = with_starts(rows.values(), self.owned.starts)
        late = self._too_late(placed, kept, earlier)
        rows = {session: replace(each, late=session in late) for session, each in rows.items()}
        left_out = late | {session: reason for session, reason in foreign.items() if session in rows}
        left_out |= {
            session: f"{each['gone']}; give the log again, or correct the mapping"
            for session, recordings in kept_recordings(self.results).items()
            for each in recordings
            if each.get("outdated")
        }
        counted = [each for each in entries if not each.withdrawn]
        left_out |= doubts([row for row in placed if row.session not in left_out], counted, self.now)
        used, plan = [row for row in placed if row.session not in left_out], self.owned.monitor_plan()
        rests_on = [
            self.code,
            asdict(replace(self.owned, channels=None, model="")),  # the sessions contain their effects
            [asdict(each) for each in entries],
            asdict(in_force(entries, [row.start for row in used], self.now, plan.acknowledged_days)),
            [(each.session, rows[each.session].key) for each in placed],
            left_out,
        ]
        state = hashlib.sha256(json.dumps(rests_on, sort_keys=True, default=str).encode()).hexdigest()
        there = all((self.into / place(self.name)).is_file() for place in (session_file, state_file, pane_file))
        if earlier and earlier.line.state == state and there and not damaged:
            return Known(earlier.line, left_out, failed)
        found = assess(self.name, used, entries, plan, self.now)
        line = line_of(found, placed, left_out, state, self.owned.about, len(late))
        write_rows(draft / session_file(self.name), placed, rows, left_out, found.trends)
        about: dict[str, Any] = {"line": asdict(line), "dimensions": asdict(self.owned.dimensions)}
        about |= {"left_out": left_out, "late": [*late]}
        bases = {name: asdict(each)["baseline"] for name, each in found.trends.items()}
        about |= {"assessment": {**found.to_dict(), "trends": bases}}
        write_json(draft / state_file(self.name), about)
        write_text(draft / pane_file(self.name), health_pane(found, placed, entries, left_out, self.owned.about))
        news = self._news(earlier, kept, rows, line, found.model)
        return Known(line, left_out, failed, tuple(news), tuple(damaged))

    def _too_late(
        self, placed: Sequence[SessionRow], kept: Mapping[str, KeptRow], earlier: Earlier | None
    ) -> dict[str, str]:
        """State by session why it came too late; what the fleet file corrects is not too late."""
        late = earlier.late if earlier else ()
        stay = (each for name, each in kept.items() if not each.late and name not in late)
        before = {each.row.session: each.placed or each.row.start for each in stay}
        newest = earlier.line.last_start if earlier else max(before.values(), default="")
        new = [row for row in placed if not stated_start(row.session, self.owned.starts)]
        return too_late(new, before, newest, self.owned.late)

    def not_assessed(self, draft: Path, error: Exception) -> Known:
        """Keep the assessment of the run before, if there is one, after an error in ``known``."""
        for place in (session_file, state_file, pane_file):
            (draft / place(self.name)).unlink(missing_ok=True)
        earlier = read_or_name(self.into, state_file(self.name), Earlier.read, None, "", [])
        found = Assessment(self.name, "undecided", "The cylinder was not assessed.")
        line = earlier.line if earlier else line_of(found, [], {}, "", self.owned.about)
        line = replace(line, look="the last run met an error and did not assess it", rank=min(line.rank, LOOK))
        return Known(line, damaged=(self.error("was not assessed", error),))

    def error(self, outcome: str, error: Exception) -> Refused:
        """Report an error that concerns only this cylinder."""
        return Refused(self.name, f"{outcome}, because of {type(error).__name__}: {' '.join(str(error).split())}")

    def _channels(self) -> dict[str, Any] | None:
        if self.owned.channels is None:
            return None
        return load_settings(self.owned.channels) | {"source": str(self.root)}

    def _row(self, recordings: Sequence[Recording]) -> SessionRow:
        identified = self.owned.load in ("none", "position")
        measured = not identified and all(LOAD_FORCE in each.columns for each in recordings)
        plan = self.owned.indicator_plan("measured" if measured else "none")
        row = session_row(recordings, self.owned.cylinder(self.name), plan, self.name)
        return row if self.stated is None else replace(row, held=held_label(recordings, self.stated))

    def _news(
        self,
        earlier: Earlier | None,
        kept: Mapping[str, object],
        rows: Mapping[str, object],
        line: CylinderLine,
        model: ModelBounds | None,
    ) -> list[str]:
        news, now = [], asdict(self.owned.dimensions)
        before = earlier.dimensions if earlier else now
        if changes := [f"{each} from {before[each]:g} to {now[each]:g}" for each in now if now[each] != before[each]]:
            news.append(
                f"fleet.yaml changes {', '.join(changes)}: all its logs were processed anew. If another cylinder was "
                "fitted, give that one a name of its own instead: its sessions are not comparable"
            )
        if new := [session for session in rows if session not in kept]:
            news.append(f"{len(new)} new {'session' if len(new) == 1 else 'sessions'}")
        if lost := [session for session in kept if session not in rows]:
            news.append(f"sessions that are not there any more: {', '.join(lost)}")
        if model and model.proposed and not (earlier and earlier.proposed):
            news.append(model.words)
        was = earlier.line.answer if earlier else ""
        if line.answer != was:
            news.append(f"{line.answer}{was and f', before: {was}'}: {line.words}")
        return [f"{self.name}: {each}" for each in news]


def _unknown_starts(starts: Mapping[str, str], sessions: Sequence[str]) -> dict[str, str]:
    """Explain each key of ``starts`` that names no session."""
    unknown = [each for each in starts if not any(stated_start(session, {each: each}) for session in sessions)]
    return {f"starts: {each}": "no session has this name; correct it in fleet.yaml" for each in unknown}
