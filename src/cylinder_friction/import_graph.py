"""The import graph: the files of a package, and of the packages it uses, that decide what a module does."""

from __future__ import annotations

import ast
import hashlib
import re
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import chain
from pathlib import Path

SOURCE = Path(__file__).parents[1]
PACKAGES: Mapping[str, Path] = {"cylinder_friction": SOURCE}
"""The folder of each package. A project that builds on this package adds its own, so that both count."""
_DOTTED = re.compile(r"\w+(\.\w+)+")
_LONGEST_PATH = 100


def code_key(*modules: str, packages: Mapping[str, Path] = PACKAGES) -> str:
    """Hash every file that decides what ``modules`` do, for the key of a result that they computed (SHA-256)."""
    digest = hashlib.sha256()
    for path in used_files(*modules, packages=packages):
        digest.update(relative_to_source(path, packages).as_posix().encode() + b"\0")
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def used_files(*modules: str, packages: Mapping[str, Path] = PACKAGES) -> tuple[Path, ...]:
    """List the files of ``modules`` and of everything they import, transitively, sorted.

    Imports inside functions count, imports for type checking do not. A string that names a module, or a file or a
    folder of data beside the module (templates, C sources, a worker script), counts as an import. The ``__init__``
    of a surrounding package counts if importing it does anything.

    Args:
        modules: Dotted names.
        packages: Package to the folder that holds it.

    Raises:
        ModuleNotFoundError: There is no such module.
    """
    files: set[Path] = set()
    seen: set[str] = set()
    queue = list(modules)
    while queue:
        module = queue.pop()
        if module in seen:
            continue
        seen.add(module)
        path = module_path(module, packages)
        if path is None:
            raise ModuleNotFoundError(f"{module}: no such module below {', '.join(map(str, packages.values()))}")
        files.add(path)
        names, data = _strings(path, packages)
        files |= data
        queue += imported_modules(module, packages) | names
        for package in _packages(module):
            init = module_path(package, packages)
            if init is not None and does_something(init, packages):
                files.add(init)
                queue += _imports(init, package, packages, deep=False)
    return tuple(sorted(files))


def imported_modules(module: str, packages: Mapping[str, Path] = PACKAGES, *, type_checking: bool = False) -> set[str]:
    """Find the modules of ``packages`` that a module itself imports, anywhere in its code.

    Args:
        module: Dotted name.
        packages: The folder of each package.
        type_checking: Whether imports under ``if TYPE_CHECKING`` count.
    """
    path = module_path(module, packages)
    return set() if path is None else _imports(path, module, packages, type_checking=type_checking) - {module}


def remove_stale_machine_code(packages: Mapping[str, Path] = PACKAGES) -> None:
    """Remove Numba's cache files beside modules if a file that decides what the modules do is newer.

    Numba checks only the file of a function, not those of the functions and constants that it uses: after a change of
    these it would continue to run the old machine code.
    """
    for kept in chain.from_iterable((each / name).rglob("__pycache__/*.nbi") for name, each in packages.items()):
        source = kept.parent.parent / f"{kept.name.partition('.')[0]}.py"
        files = used_files(_module_name(source, packages), packages=packages) if source.is_file() else ()
        if not files or kept.stat().st_mtime <= max(file.stat().st_mtime for file in files):
            kept.unlink()


def module_path(module: str, packages: Mapping[str, Path] = PACKAGES) -> Path | None:
    """Find a module's file; None if none of the packages has such a module."""
    source = packages.get(module.partition(".")[0])
    if source is None:
        return None
    place = source.joinpath(*module.split("."))
    candidates = (place.with_suffix(".py"), place / "__init__.py")
    return next((path for path in candidates if path.is_file()), None)


def all_modules(packages: Mapping[str, Path] = PACKAGES) -> list[str]:
    """List the dotted names of all modules of the packages."""
    paths = (path for package, source in packages.items() for path in (source / package).rglob("*.py"))
    return sorted(_module_name(path, packages) for path in paths)


def relative_to_source(path: Path, packages: Mapping[str, Path] = PACKAGES) -> Path:
    """Shorten a file's path to the part below its package's folder."""
    return path.relative_to(_source_of(path, packages))


def does_something(init: Path, packages: Mapping[str, Path] = PACKAGES) -> bool:
    """Check whether a package's ``__init__`` runs more than definitions and imports from elsewhere."""
    if _imports(init, _module_name(init, packages), packages, deep=False):
        return True
    for node in _parsed(init).body:
        if isinstance(node, ast.Import | ast.ImportFrom | ast.FunctionDef):
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            continue
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            continue
        value = node.value if isinstance(node, ast.Assign | ast.AnnAssign) else None
        if not isinstance(value, ast.Constant | ast.Dict | ast.Tuple | ast.List):
            return True
    return False


def _module_name(path: Path, packages: Mapping[str, Path]) -> str:
    parts = relative_to_source(path, packages).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _packages(module: str) -> list[str]:
    """List the packages around a module, without the outermost, which imports its names on first use."""
    parts = module.split(".")
    return [".".join(parts[:length]) for length in range(2, len(parts))]


def _source_of(path: Path, packages: Mapping[str, Path]) -> Path:
    return next(source for source in packages.values() if path.is_relative_to(source))


@cache
def _tree(path: Path, _modified_ns: int) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _parsed(path: Path) -> ast.Module:
    return _tree(path, path.stat().st_mtime_ns)


@cache
def _nodes(tree: ast.Module, *, deep: bool, type_checking: bool) -> tuple[ast.AST, ...]:
    return tuple(_walk(tree, deep=deep, type_checking=type_checking))


def _walk(node: ast.AST, *, deep: bool, type_checking: bool) -> Iterator[ast.AST]:
    for child in ast.iter_child_nodes(node):
        if not deep and isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            continue
        if isinstance(child, ast.If) and not type_checking and "TYPE_CHECKING" in ast.dump(child.test):
            for other in child.orelse:
                yield other
                yield from _walk(other, deep=deep, type_checking=type_checking)
            continue
        yield child
        yield from _walk(child, deep=deep, type_checking=type_checking)


def _imports(
    path: Path, module: str, packages: Mapping[str, Path], *, deep: bool = True, type_checking: bool = False
) -> set[str]:
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    found: set[str] = set()
    for node in _nodes(_parsed(path), deep=deep, type_checking=type_checking):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            parts = package.split(".")[: -(node.level - 1) or None] if node.level else []
            base = ".".join([*parts, *([node.module] if node.module else [])])
            inner = {f"{base}.{alias.name}" for alias in node.names}
            modules = {name for name in inner if module_path(name, packages) is not None}
            found |= modules | ({base} if len(modules) < len(inner) else set())
    return {name for name in found if module_path(name, packages) is not None}


def _strings(path: Path, packages: Mapping[str, Path]) -> tuple[set[str], set[Path]]:
    """Find the modules and data files that a module's string constants name."""
    names: set[str] = set()
    data: set[Path] = set()
    source = _source_of(path, packages)
    folders = [folder for folder in path.parents if source in folder.parents]
    for node in _nodes(_parsed(path), deep=True, type_checking=False):
        if not (isinstance(node, ast.Constant) and isinstance(node.value, str) and 1 < len(node.value) < _LONGEST_PATH):
            continue
        text = node.value.partition(":")[0]
        if _DOTTED.fullmatch(text) and module_path(text, packages) is not None:
            names.add(text)
        if not re.fullmatch(r"\w[\w./-]*", text):
            continue
        for place in (folder / text for folder in folders if text != "__init__.py"):  # every package has one
            if place.is_file() and place.suffix == ".py":
                names.add(_module_name(place, packages))
            elif place.is_file():
                data.add(place)
            elif place.is_dir() and not any(place.rglob("*.py")):
                data |= {file for file in place.rglob("*") if file.is_file() and "__pycache__" not in file.parts}
    return names, data
