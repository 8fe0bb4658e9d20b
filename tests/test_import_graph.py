"""Which files decide what a module does: imports of every kind, names in strings, data files; nothing else."""

import os
from pathlib import Path

import pytest

from cylinder_friction.import_graph import SOURCE, code_key, imported_modules, remove_stale_machine_code, used_files

MODULES = {
    "__init__.py": '"""The front page."""\n_LAZY = {"a": "cylinder_friction.unused"}\ndef __getattr__(name): ...\n',
    "stage.py": """
from __future__ import annotations
import numpy
from cylinder_friction.work import do, inner
if TYPE_CHECKING:
    from cylinder_friction.unused import Thing
else:
    import cylinder_friction.otherwise
KIND = "cylinder_friction.by_name:Kind"
TEMPLATE = "pages/page.html"
""",
    "otherwise.py": "",
    "by_name.py": "class Kind: ...",
    "unused.py": "class Thing: ...",
    "pages/page.html": "<p>",
    "work/__init__.py": "import os\nos.environ['A'] = 'b'",
    "work/inner.py": "def do():\n    from . import late\n    from .. import upward",
    "work/late.py": "WORKER = 'worker_script.py'",
    "work/worker_script.py": "SOURCES = 'sources'",
    "work/sources/a.c": "int a;",
    "upward.py": "FRONT = '__init__.py'",
}


@pytest.fixture
def source(tmp_path: Path) -> Path:
    for name, text in MODULES.items():
        path = tmp_path / "cylinder_friction" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return tmp_path


def test_every_file_that_decides_what_a_module_does_is_found(source: Path) -> None:
    found = {
        path.relative_to(source / "cylinder_friction").as_posix()
        for path in used_files("cylinder_friction.stage", packages={"cylinder_friction": source})
    }
    assert found == set(MODULES) - {"__init__.py", "unused.py"}


def test_caches_inside_a_folder_of_data_do_not_count(source: Path) -> None:
    before = used_files("cylinder_friction.work.worker_script", packages={"cylinder_friction": source})
    cache = source / "cylinder_friction/work/sources/__pycache__"
    cache.mkdir()
    for name in ("a.cpython-312.pyc", "a.step-1.py312.nbi", "a.step-1.py312.1.nbc"):
        (cache / name).write_bytes(b"\0")
    assert used_files("cylinder_friction.work.worker_script", packages={"cylinder_friction": source}) == before


def test_imports_for_type_checking_count_only_where_they_are_asked_for(source: Path) -> None:
    runtime = imported_modules("cylinder_friction.stage", {"cylinder_friction": source})
    assert runtime == {"cylinder_friction.work", "cylinder_friction.work.inner", "cylinder_friction.otherwise"}
    assert imported_modules("cylinder_friction.stage", {"cylinder_friction": source}, type_checking=True) - runtime == {
        "cylinder_friction.unused"
    }


def test_a_key_covers_what_is_used_and_nothing_else() -> None:
    key = code_key("cylinder_friction.realtime.lstm")
    assert key == code_key("cylinder_friction.realtime.lstm")
    assert key != code_key("cylinder_friction.estimators.hybrid")
    used = used_files("cylinder_friction.estimators.hybrid")
    assert SOURCE / "cylinder_friction/realtime/lstm.py" in used
    assert not [path for path in used if "deployment" in path.parts or "tracking" in path.parts]
    assert SOURCE / "cylinder_friction/deployment/templates/estimator.h.j2" in used_files(
        "cylinder_friction.deployment.rendering"
    )


def test_machine_code_older_than_what_it_was_made_of_is_removed(tmp_path: Path) -> None:
    package = tmp_path / "cylinder_friction"
    kept = package / "__pycache__" / "step.run-3.py311.nbi"
    kept.parent.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "level.py").write_text("LEVEL = 1\n")
    (package / "step.py").write_text("from cylinder_friction.level import LEVEL\n")
    kept.touch()
    for age_s, stays in ((-10.0, True), (10.0, False)):
        changed = kept.stat().st_mtime + age_s
        for path in package.glob("*.py"):
            os.utime(path, (changed - 1.0, changed - 1.0))
        os.utime(package / "level.py", (changed, changed))
        remove_stale_machine_code({"cylinder_friction": tmp_path})
        assert kept.exists() == stays
