from pathlib import Path

import pytest

from cylinder_friction.recordings.path_names import NameRules, PathNames
from cylinder_friction.recordings.recording import RecordingError

FOLDERS = r"^(?P<session>(?P<condition>\w+)_\d+)/(?P<load>\d+kg)"
FIRST = "condition1_session07_recording02"
RIG = r"(?P<session>condition(?P<condition>[^_/]+)_session[^_/]+)_[^/]*\.csv$"


@pytest.mark.parametrize(
    ("pattern", "path", "expected"),
    [
        (RIG, f"{FIRST}.csv", (FIRST, "1", "condition1_session07", "")),
        (r"(?P<session>_\d{6})\.", "Jib_230425.csv.gz", ("Jib_230425.csv", "1", "_230425", "")),
        (FOLDERS, "crane_3/20kg.part.csv", ("crane_3-20kg.part", "crane", "crane_3", "20kg")),
    ],
)
def test_a_pattern_reads_names(pattern: str, path: str, expected: tuple[str, str, str, str]) -> None:
    assert NameRules(pattern).names(path) == PathNames(*expected)
    with pytest.raises(RecordingError, match=r"path 'notes.csv' does not give condition and session"):
        NameRules(pattern).names("notes.csv")


def table_at(folder: Path, text: str) -> NameRules:
    path = folder / "names.csv"
    path.write_text(text, encoding="utf-8")
    return NameRules(table=path)


TABLE = """File;Condition;Session;Load
monday/a.mat;no load;mo;
tuesday\\b.mat;no load;tu;none
"""


def test_a_table_names_files(tmp_path: Path) -> None:
    rules = table_at(tmp_path, TABLE)
    assert rules.names("monday/a.mat") == PathNames("monday-a", "no load", "mo", "")
    assert rules.names("tuesday/b.mat") == PathNames("tuesday-b", "no load", "tu", "none")
    with pytest.raises(RecordingError, match=r"path 'b.csv' has no line in the table of names; add one with its cond"):
        rules.names("b.csv")
    rules = table_at(tmp_path, "\ufefffile,condition,session\n\na.csv,1,s1\ngone.csv,1,s1\n")
    assert rules.names("a.csv") == PathNames("a", "1", "s1", "")
    (said,) = rules.lines_without_file(["a.csv", "y/b.csv"])
    assert said.startswith("the table of names has a line for 'gone.csv', which is not there; correct the line")
    assert NameRules(pattern=RIG).lines_without_file(["a.csv"]) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"expected one column 'file' in its header, but got nothing"),
        ("file,condition\na,1\n", r"expected one column 'session' in its header, but got 'file', 'condition'"),
        ("file,condition,session\na.csv,1,s\nb.csv,1,s\na.csv,2,t\n", r"line 4 is for 'a.csv' again; expected one"),
        ("file,condition,session\na.csv,,s\n", r"line 2 has no condition; fill in the cell"),
        ("file,condition,session\na.csv,1\n", r"line 2 has 2 cells, its header 3"),
    ],
)
def test_damaged_table_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        table_at(tmp_path, text)
    with pytest.raises(RecordingError, match=r"table of names 'none.csv' cannot be read"):
        NameRules(table=tmp_path / "none.csv")


@pytest.mark.parametrize("path", ["back\\slash.csv", "new\nline.csv", "day/bytes\udcff.csv"])
def test_a_name_that_other_systems_cannot_have_is_refused(path: str) -> None:
    with pytest.raises(RecordingError, match="holds a backslash, a control character or bytes that are not UTF-8"):
        NameRules(condition="1").names(path)
    assert NameRules(condition="1").names("Öl\u00a05 °C.csv").name == "Öl\u00a05 °C"
