"""Run ``cylinder-friction estimate`` on one log; count how often the log is opened and parsed, and the modules entered.

    python tests/traced_estimate.py LOG FOLDER [OPTION ...]

writes ``FOLDER/traced.json``.

A module counts if one of its functions is called once all modules are imported.
"""

import json
import os
import sys
from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import csv

PACKAGE = "cylinder_friction"
NOT_CALLED = ("<module>", "<lambda>", "__create_fn__", "<listcomp>", "<genexpr>", "<dictcomp>", "<setcomp>")


def main() -> None:
    log, folder, *options = sys.argv[1:]
    opened, parsed, modules = list[str](), list[str](), set[str]()

    def heard(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open" and str(arguments[0]) == log:
            opened.append(str(arguments[1]))

    def counted(function: Any, calls: list[str], of_log: bool) -> Any:
        def call(*arguments: Any, **more: Any) -> Any:
            if not of_log or os.fsdecode(arguments[0]) == log:
                calls.append(function.__name__)
            return function(*arguments, **more)

        return call

    def called(frame: Any, event: str, _argument: object) -> None:
        name = frame.f_globals.get("__name__", "")
        if event == "call" and name.startswith(PACKAGE) and not frame.f_code.co_name.startswith(NOT_CALLED):
            modules.add(name.removeprefix(f"{PACKAGE}."))

    from cylinder_friction.commands.cli import main as command

    arguments = ["estimate", log, "--json", *options, "--output"]
    command([*arguments, f"{folder}-first"])  # which imports everything
    csv.read_csv = counted(csv.read_csv, parsed, of_log=False)
    pa.OSFile, pa.memory_map = (counted(each, opened, of_log=True) for each in (pa.OSFile, pa.memory_map))
    sys.addaudithook(heard)
    sys.setprofile(called)
    status = command([*arguments, folder])
    sys.setprofile(None)
    found = {"status": status, "opened": opened, "parsed": parsed, "modules": sorted(modules)}
    Path(folder, "traced.json").write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
