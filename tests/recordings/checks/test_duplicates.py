import numpy as np
import pytest

from cylinder_friction.recordings.checks.duplicates import Samples, SeenRecordings
from cylinder_friction.recordings.recording import Columns, RecordingError, RecordingMetadata


def columns(seed: int = 0, rows: int = 2000) -> dict[str, np.ndarray]:
    noise = np.random.default_rng(seed).normal(size=(3, rows))
    names = {"pressure_1_pa": 20e5, "pressure_2_pa": 9e5, "position_m": 0.1}
    return {name: size * (1.0 + 1e-3 * each) for (name, size), each in zip(names.items(), noise, strict=True)}


def samples(table: Columns, start: str = "", session: str = "monday") -> Samples:
    return Samples.of(RecordingMetadata("any", "1", session, 0.005, start=start), table)


def psi(table: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the table as read from a file in psi and inches."""
    scale = {"pressure_1_pa": 6894.757, "pressure_2_pa": 6894.757, "position_m": 0.0254}
    return {name: values / scale[name] * scale[name] for name, values in table.items()}


def test_the_same_samples_are_a_copy_in_any_unit() -> None:
    seen = SeenRecordings()
    for seed in range(20):
        seen.refuse(f"recording{seed}", f"{seed}.csv", samples(columns(seed)))
    words = r"holds the same samples as recording 'recording7' of 7\.csv; a copy would be counted twice, .*; keep one"
    with pytest.raises(RecordingError, match=words):
        seen.refuse("again", "again.mat", samples(psi(columns(7))))
    with pytest.raises(RecordingError, match=r"has the name 'recording3', which 3\.csv has already"):
        seen.refuse("recording3", "other.csv", samples(columns(99)))
    force = {"drive_force_n": columns(1)["pressure_1_pa"], "position_m": columns(1)["position_m"]}
    seen.refuse("force", "force.csv", samples(force))
    with pytest.raises(RecordingError, match="the same samples as recording 'force'"):
        seen.refuse("force again", "again.csv", samples(force))


def test_what_an_earlier_run_held_is_remembered() -> None:
    seen = SeenRecordings()
    seen.remember("before", "before.csv", "0" * 64, samples(columns()))
    assert seen.digests == {"0" * 64: "before.csv"}
    with pytest.raises(RecordingError, match=r"the same samples as recording 'before' of before\.csv"):
        seen.refuse("again", "again.csv", samples(columns()))


@pytest.mark.parametrize(
    ("starts", "session", "words"),
    [
        (("2026-03-14T08:15:00.000", "2026-03-14T08:15:04.000"), "monday", "a and b by 6 s; if they are of the same"),
        (("2026-03-14T08:15:04.000", "2026-03-14T08:15:00.000"), "monday", "b and a by 6 s"),
        (("2026-03-14T08:15:00.000", "2026-03-14T08:15:10.000"), "monday", ""),
        (("2026-03-14T08:15:00.000", "2026-03-14T08:15:09.000"), "monday", ""),  # starts are rounded
        (("2026-03-14T08:15:00.000", "2026-03-14T08:15:04.000Z"), "monday", ""),  # two clocks
        (("2026-03-14T08:15:00.000", "2026-03-14T08:15:04.000"), "tuesday", ""),
        (("2026-03-14", "2026-03-14"), "monday", ""),
        (("", ""), "monday", ""),
    ],
)
def test_overlapping_recordings_of_a_session_are_named(starts: tuple[str, str], session: str, words: str) -> None:
    seen = SeenRecordings()
    for seed, (name, start, own) in enumerate(zip("ab", starts, ("monday", session), strict=True)):
        seen.refuse(name, f"{name}.csv", samples(columns(seed), start, own))
    assert (words in seen.overlaps()) if words else seen.overlaps() == ""
