"""Contents of a served model: the package's code that it runs, its requirements and its metadata."""

import shutil
from importlib.metadata import EntryPoint, PackageNotFoundError, distribution, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from cylinder_friction.deployment.descriptions import described_inputs
from cylinder_friction.deployment.scoring import RECORDING_COLUMN, TIME_COLUMN
from cylinder_friction.estimators.entry_points import own_kinds
from cylinder_friction.import_graph import PACKAGES, SOURCE, all_modules, imported_modules, used_files
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.refusal import RefusalError

PACKAGE = SOURCE / "cylinder_friction"
MODEL_CODE = PACKAGE / "deployment/scoring_model.py"
SERVED_MODULES = (
    "cylinder_friction.deployment.golden_trajectory",
    "cylinder_friction.deployment.scoring",
    "cylinder_friction.estimators.loading",
)
"""Modules that the served model runs; the model contains them, and all modules that they import."""
REQUIREMENTS = ("mlflow", "numba", "numpy", "onnx", "pandas", "pyarrow", "pyyaml", "scipy", "tqdm")
"""Packages that the served model needs to load and to estimate; neither torch nor scikit-learn is among them."""


def copy_code(folder: Path, kind: str) -> list[Path]:
    """Copy what a model of this kind needs into a folder: modules of this package, and an estimator's own package.

    Returns:
        The copies at the top of the folder, for the model's ``code``.

    Raises:
        RefusalError: The estimator's own package cannot be brought along.
    """
    modules = [*SERVED_MODULES, *imported_modules(PACKAGE.name)]
    packages = dict(PACKAGES)
    if own := own_kinds().get(kind):
        top, source = _own_package(own)
        _copy_own_package(own, source / top, folder)
        packages |= {top: source}
        modules += all_modules({top: source}) if (source / top).is_dir() else [top]
    used = {each for each in used_files(*modules, packages=packages) if each.is_relative_to(PACKAGE)}
    folders = {parent for path in used for parent in path.parents if parent.is_relative_to(PACKAGE)}
    for path in used | {each / "__init__.py" for each in folders}:
        target = folder / path.relative_to(SOURCE)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, target)
    return sorted(folder.iterdir())


def _own_package(entry: EntryPoint) -> tuple[str, Path]:
    """Find the outermost module or package of an estimator of another package, and the folder that holds it."""
    top = entry.module.partition(".")[0]
    spec = find_spec(top)
    if spec is None or not (spec.origin or "").endswith(".py") or entry.dist is None:
        raise RefusalError(
            f"estimator {entry.name!r}: its package {top!r} has no Python source that a model can bring along; "
            "expected a module, or a package with __init__.py; write it so, or register another candidate"
        )
    path = Path(str(spec.origin))
    return top, path.parents[1 if path.name == "__init__.py" else 0]


def _copy_own_package(entry: EntryPoint, place: Path, folder: Path) -> None:
    """Copy an estimator's package with what registers it, so that its class is found without an installation."""
    dist = entry.dist
    assert dist is not None
    if place.is_dir():
        shutil.copytree(place, folder / place.name, ignore=shutil.ignore_patterns("__pycache__"))
    else:
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(place.with_suffix(".py"), folder / f"{place.name}.py")
    described = folder / f"{canonicalize_name(dist.name).replace('-', '_')}-{dist.version}.dist-info"
    described.mkdir()
    for name in ("METADATA", "entry_points.txt"):
        (described / name).write_text(dist.read_text(name) or "", encoding="utf-8")


def requirements_of(kind: str) -> list[str]:
    """List the packages that a model needs, with those that an estimator of another package requires.

    Raises:
        RefusalError: A required package is not installed, or is one that no package index has.
    """
    own = own_kinds().get(kind)
    stated = [Requirement(each) for each in own.dist.requires or []] if own and own.dist else []
    applying = [each.name for each in stated if each.marker is None or each.marker.evaluate()]
    named = {name: version(name) for name in REQUIREMENTS}
    for name in applying:
        if canonicalize_name(name) == "cylinder-friction":  # the model brings it along
            continue
        try:
            found = distribution(name)
        except PackageNotFoundError:
            raise RefusalError(f"estimator {kind!r} requires {name!r}, which is not installed; install it") from None
        if found.read_text("direct_url.json") is not None:
            raise RefusalError(
                f"estimator {kind!r} requires {name!r}, which was installed from a folder or an address, so that a "
                "server would take whatever has this name on a package index; put its modules into the estimator's "
                "package, or install it from an index"
            )
        named.setdefault(found.name, found.version)
    return [f"{name}=={number}" for name, number in named.items()]


def model_metadata(model: StepModel) -> dict[str, Any]:
    """Collect the metadata of the logged model: its inputs, sample time and bounds."""
    optional = {
        RECORDING_COLUMN: "optional: the name of each row's recording, whose rows follow each other",
        TIME_COLUMN: "optional: each row's time, to be checked [s]",
    }
    return {
        "inputs": {each.column: each.meaning for each in described_inputs(model.inputs)} | optional,
        "sample_time_s": float(model.sample_time_s),
        "bounds": model.bounds.in_words(),
        **({"corrections": applied} if (applied := model.applied()) else {}),
        **({} if model.trained_for is None else {"trained_for": model.trained_for.in_words()}),
    }
