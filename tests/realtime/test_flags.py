"""Flags as the guide and combined bits show them."""

from pathlib import Path

from cylinder_friction.realtime.flags import Flag

GUIDE = Path(__file__).parents[2] / "docs/real-time.md"
HEAD = "| bit | name | kind | set while | what to do |\n|---:|---|---|---|---|\n"


def test_the_guides_table_is_that_of_the_flags() -> None:
    rows = [f"| {flag.value} | `{flag.name}` | {flag.kind} | {flag.meaning} | {flag.advice} |\n" for flag in Flag]
    expected = HEAD + "".join(rows)
    assert expected in GUIDE.read_text(encoding="utf-8"), f"the guide's table should read\n{expected}"


def test_names_come_lowest_bit_first_and_kinds_share_no_bit() -> None:
    assert Flag.names(Flag.FROZEN | Flag.NOT_READY | 1 << 20) == ("NOT_READY", "FROZEN")
    kinds = [Flag.of_kind(kind) for kind in ("settling", "sensor", "range")]
    assert sum(kinds) == sum(Flag)
    assert Flag.of_kind("range") & (Flag.OUTSIDE | Flag.FROZEN) == Flag.OUTSIDE
