from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata, SensorUncertainty
from cylinder_friction.recordings.storage import (
    read_metadata,
    read_recording,
    read_stored,
    recording_paths,
    write_recording,
)

STEP_S = 0.005
METADATA = RecordingMetadata(
    "made",
    "1",
    "s1",
    STEP_S,
    "a cylinder",
    zero_offset={"pressure_1_pa": 120.0},
    uncertainty={"pressure_1_pa": SensorUncertainty(1e3, 0.002, 6.1e3)},
    repairs=("position_m: 3 samples bridged",),
)


def made(rows: int = 4000, **columns: object) -> Recording:
    generator = np.random.default_rng(rows)
    samples = np.cumsum(generator.normal(size=(rows, 3)), axis=0)
    names = ("pressure_1_pa", "pressure_2_pa", "position_m")
    table = {"time_s": STEP_S * np.arange(rows)} | dict(zip(names, (samples * [6103.5, 6103.5, 6.1e-5]).T, strict=True))
    return Recording(METADATA, pd.DataFrame(table | columns))


@pytest.mark.parametrize("rows", [1, 4000])
def test_what_is_written_is_read_back_bit_for_bit(tmp_path: Path, rows: int) -> None:
    recording = made(
        rows, friction_n=np.full(rows, -0.0), load_force_n=np.full(rows, np.nan), usable=np.arange(rows) % 3 > 0
    )
    again = read_recording(write_recording(tmp_path, recording))
    assert again.metadata == METADATA
    pd.testing.assert_frame_equal(pd.read_parquet(next(tmp_path.iterdir())), again.table)
    assert again.table.dtypes.to_dict() == recording.table.dtypes.to_dict()
    assert list(again.columns) == list(recording.columns)
    for column in recording.table.columns:
        assert again.table[column].to_numpy().tobytes() == recording.table[column].to_numpy().tobytes(), column


def test_equal_recordings_make_equal_bytes(tmp_path: Path) -> None:
    recording = made()
    paths = [write_recording(tmp_path / "one", recording)]
    for place, table in (
        ("in_one_block", pd.DataFrame(recording.table.to_numpy(), columns=recording.table.columns)),
        ("read_back", read_recording(paths[0]).table),
        ("cut_out", pd.concat([recording.table, recording.table]).iloc[: len(recording)]),
    ):
        paths.append(write_recording(tmp_path / place, replace(recording, columns=table)))
    assert len({path.read_bytes() for path in paths}) == 1


def test_a_folder_is_read_in_the_order_of_names_without_foreign_files(tmp_path: Path) -> None:
    for name in ("b", "a", "c"):
        write_recording(tmp_path, replace(made(), metadata=replace(METADATA, name=name)))
    assert [recording.name for recording in read_stored(tmp_path)] == ["a", "b", "c"]
    with pytest.raises(FileNotFoundError, match="no such folder of recordings; run `dvc repro`"):
        recording_paths(tmp_path / "absent")
    made().table.to_parquet(tmp_path / "foreign.parquet")
    for read in (read_recording, read_metadata):
        with pytest.raises(RecordingError, match=r"foreign\.parquet: no recording metadata inside; expected a file"):
            read(tmp_path / "foreign.parquet")
