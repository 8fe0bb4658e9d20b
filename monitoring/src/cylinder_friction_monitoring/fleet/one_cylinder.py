"""One cylinder's part of a run: its new logs become sessions, and what is known of it is written down."""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from cylinder_friction import Recording, estimate_logs
from cylinder_friction.estimation.kept_results import OtherCylinderError, kept_recordings, made_with_model, stated_share
from cylinder_friction.files.whole_files import read_json, write_json, write_text
from cylinder_friction.recordings.columns import LOAD_FORCE
from cylinder_friction.recordings.reading_logs import load_settings
from cylinder_friction_monitoring.errors import MonitoringError, Refused
from cylinder_friction_monitoring.fleet.doubts import doubts
from cylinder_friction_monitoring.fleet.files import RESULTS, pane_file, session_file, state_file
from cylinder_friction_monitoring.fleet.plan import Dimensions, FleetCylinder
from cylinder_friction_monitoring.fleet.sessions import read_rows, updated_rows, with_starts, write_rows
from cylinder_friction_monitoring.page.health_page import health_pane
from cylinder_friction_monitoring.trends.assessment import Entry, ModelBounds
from cylinder_friction_monitoring.trends.cylinder_line import CylinderLine, Trend, line_of
from cylinder_friction_monitoring.trends.held_label import held_label
from cylinder_friction_monitoring.trends.in_force import in_force
from cylinder_friction_monitoring.trends.indicators import session_row
from cylinder_friction_monitoring.trends.session_row import SessionRow
from cylinder_friction_monitoring.trends.verdict import assess


@dataclass(frozen=True)
class Taken:
    """What became of a cylinder's logs."""

    refused: tuple[Refused, ...] = ()
    notes: tuple[str, ...] = ()
    # By the SHA-256 of each log that is kept: its session, and whether it is among the logs of this run
    logs: Mapping[str, tuple[str, bool]] = field(default_factory=dict)


@dataclass(frozen=True)
class Known:
    """What is known of a cylinder, and what is new about it."""

    line: CylinderLine
    changed: bool  # Whether its files were written anew
    left_out: Mapping[str, str] = field(default_factory=dict)  # Why sessions are not assessed
    failed: Mapping[str, str] = field(default_factory=dict)  # Why there is no row of a session
    news: tuple[str, ...] = ()


@dataclass(frozen=True)
class CylinderRun:
    """How one cylinder is taken through a run."""

    name: str
    owned: FleetCylinder
    into: Path  # The folder of results as the run before left it
    root: Path  # What names of logs are relative to
    code: str  # SHA-256 of the code
    now: datetime

    @property
    def results(self) -> Path:
        return self.into / RESULTS / self.name

    @property
    def made_by(self) -> str:
        """What the rows of its sessions are made by: code, settings and the model that the logs were processed with."""
        return f"{self.code} {self.owned.indicator_plan('none')} {made_with_model(self.results)}"

    def taken(self, files: Sequence[Path], any_logs: bool) -> Taken:
        """Process the new ones of a cylinder's logs.

        Args:
            files: Its logs.
            any_logs: Whether the run reads logs at all; if not, those that are kept are not gone.
        """
        refused, notes = list[Refused](), list[str]()
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
        """Assess a cylinder if anything is new about it, and write its files into a draft of the results.

        Args:
            draft: The folder for new files.
            entries: What people did and stated.
            foreign: Sessions whose logs are other cylinders', with the reason.
        """
        earlier = self._earlier()
        kept = read_rows(self.into / session_file(self.name))
        rows, failed = updated_rows(self.results, kept, self._row, self.made_by)
        placed = with_starts(rows.values(), self.owned.starts)
        left_out = {session: reason for session, reason in foreign.items() if session in rows}
        made_with = hashlib.sha256(repr(self.owned.cylinder(self.name)).encode()).hexdigest()
        left_out |= {
            session: "its log is gone, and its friction was computed with other dimensions; give the log again"
            for session, each in rows.items()
            if each.made_with not in ("", made_with)
        }
        counted = [each for each in entries if not each.withdrawn]
        left_out |= doubts([row for row in placed if row.session not in left_out], counted, self.now)
        used, plan = [row for row in placed if row.session not in left_out], self.owned.monitor_plan()
        rests_on = [
            self.code,
            asdict(replace(self.owned, channels=None, model="")),  # what they change is in the sessions
            [asdict(each) for each in entries],
            asdict(in_force(entries, [row.start for row in used], self.now, plan.acknowledged_days)),
            [(each.session, rows[each.session].key) for each in placed],
            left_out,
        ]
        state = hashlib.sha256(json.dumps(rests_on, sort_keys=True, default=str).encode()).hexdigest()
        if earlier and earlier["line"]["state"] == state:
            line = earlier["line"]
            return Known(CylinderLine(**{**line, "trend": Trend(**line["trend"])}), False, left_out, failed)
        found = assess(self.name, used, entries, plan, self.now)
        line = line_of(found, placed, left_out, state)
        write_rows(draft / session_file(self.name), placed, rows, left_out, found.trends)
        about = {"line": asdict(line), "dimensions": asdict(self.owned.dimensions), "left_out": left_out}
        assessment = {
            **found.to_dict(),
            "trends": {name: asdict(each)["baseline"] for name, each in found.trends.items()},
        }
        write_json(draft / state_file(self.name), about | {"assessment": assessment})
        write_text(draft / pane_file(self.name), health_pane(found, placed, entries, left_out))
        return Known(line, True, left_out, failed, tuple(self._news(earlier, kept, rows, left_out, line, found.model)))

    def _earlier(self) -> dict[str, Any]:
        path = self.into / state_file(self.name)
        try:
            return dict(read_json(path)) if path.is_file() else {}
        except ValueError as error:
            raise MonitoringError(f"{path}: is damaged ({error}); remove it, and it is made anew") from error

    def _channels(self) -> dict[str, Any] | None:
        if self.owned.channels is None:
            return None
        return load_settings(self.owned.channels) | {"source": str(self.root)}

    def _row(self, recordings: Sequence[Recording]) -> SessionRow:
        measured = self.owned.load == "measured" or (
            self.owned.load is None and all(LOAD_FORCE in each.columns for each in recordings)
        )
        plan = self.owned.indicator_plan("measured" if measured else "none")
        row = session_row(recordings, self.owned.cylinder(self.name), plan, self.name)
        stated = stated_share(Path(self.owned.model)) if self.owned.model else None
        return row if stated is None else replace(row, held=held_label(recordings, stated))

    def _news(
        self,
        earlier: Mapping[str, Any],
        kept: Mapping[str, object],
        rows: Mapping[str, object],
        left_out: Mapping[str, str],
        line: CylinderLine,
        model: ModelBounds | None,
    ) -> list[str]:
        news, before = [], earlier.get("dimensions")
        if before and Dimensions(**before) != self.owned.dimensions:
            now = asdict(self.owned.dimensions)
            old = asdict(Dimensions(**before))
            changes = [f"{name} from {old[name]:g} to {now[name]:g}" for name in now if now[name] != old[name]]
            news.append(
                f"fleet.yaml changes {', '.join(changes)}: all its logs were processed anew. If another cylinder was "
                "fitted, give that one a name of its own instead: its sessions are not comparable"
            )
        if new := [session for session in rows if session not in kept]:
            news.append(f"{len(new)} new {'session' if len(new) == 1 else 'sessions'}")
        if lost := [session for session in kept if session not in rows]:
            news.append(f"sessions that are not there any more: {', '.join(lost)}")
        news += [
            f"{each} is not assessed: {why}"
            for each, why in left_out.items()
            if why != earlier.get("left_out", {}).get(each)
        ]
        was = earlier["line"]["answer"] if earlier else ""
        if model and model.proposed and not ((earlier.get("assessment") or {}).get("model") or {}).get("proposed"):
            news.append(model.words)
        if line.answer != was:
            news.append(f"{line.answer}{was and f', before: {was}'}: {line.words}")
        return [f"{self.name}: {each}" for each in news]
