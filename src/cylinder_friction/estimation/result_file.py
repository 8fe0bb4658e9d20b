"""The result of one recording: a Parquet file of friction that states in its metadata all that later runs need."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np

from cylinder_friction.estimation.results import FrictionOfRecording
from cylinder_friction.evaluation.friction_levels import FrictionLevel
from cylinder_friction.labelling.known_offset import KnownOffset, OffsetEvidence
from cylinder_friction.labelling.sliding_blocks import SlidingBlocks
from cylinder_friction.recordings.checks.duplicates import Samples
from cylinder_friction.recordings.files import whole_file, write_text
from cylinder_friction.recordings.formats.mdf_results import write_mdf
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.result_folder import refuse_foreign
from cylinder_friction.recordings.storage import read_beside, write_recording
from cylinder_friction.reporting.friction_page import pane_file

FileFormat = Literal["parquet", "csv", "mdf"]
SUFFIXES = {"csv": ".csv", "mdf": ".mf4"}
"""What further files end in that are asked for beside the Parquet file."""
ABOUT, COMPARED = "cylinder_friction_result", "cylinder_friction_compared"
"""Names of the texts in a result's metadata: what it states, and what later recordings are compared with."""
_OF_BLOCKS = ("label_n", "direction", "stroke")


@dataclass(frozen=True)
class Result:
    """What a result states beside its rows."""

    entry: FrictionOfRecording
    depends_on: Mapping[str, str]  # SHA-256 of what friction depends on beside the log
    of_file: int  # How many recordings its log gave
    beside: tuple[str, ...]  # Files that belong to it, below the folder: its pane, and its friction in another format
    bounded: bool  # Whether its friction has bounds
    offset: KnownOffset | None  # What was known of its session's offset; None with an estimator
    compared: str = field(repr=False, default="")  # As ``packed`` made it

    @classmethod
    def of(
        cls,
        entry: FrictionOfRecording,
        depends_on: Mapping[str, str],
        of_file: int,
        file_format: FileFormat,
        bounded: bool,
        offset: KnownOffset | None,
        compared: str,
    ) -> Self:
        """Return the result of a recording whose friction is wanted in a format, too."""
        also = [f"{entry.name}{SUFFIXES[file_format]}"] if file_format in SUFFIXES else []
        return cls(entry, depends_on, of_file, (*also, pane_file(entry.name)), bounded, offset, compared)

    @property
    def file(self) -> str:
        return f"{self.entry.name}.parquet"

    def is_whole(self, folder: Path) -> bool:
        """Return whether all files of the result are there."""
        return all((folder / name).is_file() for name in self.beside)

    def of_other_recordings(self) -> tuple[OffsetEvidence | None, Samples]:
        """Unpack what the recording shows of its sensors' offset, and its samples."""
        return unpacked(self.compared)

    def texts(self) -> dict[str, str]:
        about = {**vars(self), "entry": asdict(self.entry), "offset": self.offset and asdict(self.offset)}
        about.pop("compared")
        return {ABOUT: json.dumps(about, sort_keys=True), COMPARED: self.compared}


def read_result(path: Path) -> Result | None:
    """Read what a result states; None of a file that ``write_result`` did not write."""
    texts = read_beside(path)
    if ABOUT not in texts:
        return None
    about: dict[str, Any] = json.loads(texts[ABOUT])
    entry = about["entry"]
    lists = {"repairs": tuple(entry["repairs"]), "levels": tuple(FrictionLevel(**each) for each in entry["levels"])}
    about |= {
        "entry": FrictionOfRecording(**{**entry, **lists}),
        "offset": about["offset"] and KnownOffset(**about["offset"]),
        "beside": tuple(about["beside"]),
    }
    return Result(**about, compared=texts[COMPARED])


def write_result(
    folder: Path, finished: Recording, result: Result, pane: str, log: Path, listed: Collection[str] = ()
) -> None:
    """Write the files of a result; it counts once all of them are there, whenever the run ends.

    Args:
        folder: Where they go.
        finished: The recording with its friction.
        result: What it states.
        pane: What the page shows of it.
        log: What it was read from.
        listed: Files that an earlier run listed as its own.

    Raises:
        FileExistsError: A file that no earlier run wrote lies in the place of one of them.
        RecordingError: The measurement file cannot hold the results.
    """
    path = folder / result.file
    earlier = read_result(path) if path.is_file() else None
    beside = () if earlier is None else earlier.beside
    own = {*listed, *beside, *([] if earlier is None else [result.file])}
    for name in (result.file, *result.beside):
        if name not in own:
            refuse_foreign(folder / name)
    for name in {*beside, *result.beside}:  # a new result beside an old pane would be taken for whole
        (folder / name).unlink(missing_ok=True)
    write_recording(folder, finished, beside=result.texts())
    for name in result.beside:
        _write_beside(folder / name, finished, pane, log)


def _write_beside(path: Path, finished: Recording, pane: str, log: Path) -> None:
    if path.suffix == ".mf4":
        write_mdf(path, finished, log)
    elif path.suffix == ".csv":
        with whole_file(path) as draft:
            finished.table.to_csv(draft, index=False, float_format="%.9g")
    else:
        write_text(path, pane)


def packed(evidence: OffsetEvidence | None, samples: Samples) -> str:
    """Return what later recordings are compared with as text; equal content makes equal text."""
    arrays: dict[str, Any] = {}
    about = None
    if evidence is not None:
        sliding = evidence.sliding
        about = {**vars(evidence), "sliding": None}
        if sliding is not None:
            about["sliding"] = {"session": sliding.session, "prior_n": sliding.prior_n, "sliding_s": sliding.sliding_s}
            arrays |= {f"block {name}": getattr(sliding, name) for name in _OF_BLOCKS}
            arrays |= {f"column {name}": values for name, values in sliding.columns.items()}
    content = io.BytesIO()
    np.savez(content, about=np.frombuffer(json.dumps([about, asdict(samples)]).encode(), dtype=np.uint8), **arrays)
    return base64.b64encode(content.getvalue()).decode()


def unpacked(text: str) -> tuple[OffsetEvidence | None, Samples]:
    """Return what ``packed`` was given."""
    with np.load(io.BytesIO(base64.b64decode(text)), allow_pickle=False) as content:
        arrays = dict(content)
    about, samples = json.loads(arrays.pop("about").tobytes())
    kinds: dict[str, dict[str, Any]] = {"block": {}, "column": {}}
    for name, values in arrays.items():
        kind, _, what = name.partition(" ")
        kinds[kind][what] = values
    if about is not None and about["sliding"] is not None:
        about["sliding"] = SlidingBlocks(**about["sliding"], **kinds["block"], columns=kinds["column"])
    return None if about is None else OffsetEvidence(**about), Samples(**samples)
