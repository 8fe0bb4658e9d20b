"""Where a study's finished trials are kept: a journal in the repository, or a team's PostgreSQL database.

The environment chooses, not a parameter: trials are the same bit for bit wherever they are kept, so that another place
makes no stage run again.
"""

from __future__ import annotations

import hashlib
import logging
import os
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from cylinder_friction.extras import not_installed
from cylinder_friction.wording import in_brief

if TYPE_CHECKING:
    from collections.abc import Iterator

    from optuna.storages import BaseStorage
    from optuna.storages.journal import JournalStorage
    from sqlalchemy import Engine

STUDY_STORE = "CYLINDER_FRICTION_STUDY_STORE"
"""Environment variable: URL of the database, ``postgresql+psycopg2://...``; without it the journal is used."""
_FORM = "postgresql+psycopg2://USER@HOST/DATABASE"
_CONNECT_TIMEOUT_S = 5

_log = logging.getLogger(__name__)


class StudyStoreError(Exception):
    """The database that is to keep the trials cannot be used."""


@contextmanager
def study_storage(journal: Path) -> Iterator[tuple[BaseStorage, str]]:
    """Yield the storage and the name of the study whose journal would be that file.

    In a database the study has the name of the journal's folder, which states what the trials depend on: clones that
    search the same thing share its trials. One machine at a time: the others wait, and then find them finished.

    Raises:
        StudyStoreError: The database cannot be used.
    """
    url = os.environ.get(STUDY_STORE)
    if not url:
        yield _journal_storage(journal), "tuning"
    else:
        with _alone(_engine(url), journal.parent.name):
            from optuna.storages import RDBStorage

            yield RDBStorage(url), journal.parent.name


def _engine(url: str) -> Engine:
    from sqlalchemy import NullPool, create_engine
    from sqlalchemy.exc import ArgumentError

    try:
        options = {"connect_timeout": _CONNECT_TIMEOUT_S}
        # without a pool, which would keep the lock with a connection that was given back
        engine = create_engine(url, connect_args=options, isolation_level="AUTOCOMMIT", poolclass=NullPool)
    except ArgumentError:
        raise StudyStoreError(f"{STUDY_STORE} is no URL of a database; expected {_FORM}") from None
    except ModuleNotFoundError as error:
        needed = not_installed(str(error.name), "postgres")
        raise StudyStoreError(f"{STUDY_STORE} needs {needed}, and write {_FORM}") from None
    if engine.dialect.name != "postgresql":
        raise StudyStoreError(f"{STUDY_STORE} names a database of {engine.dialect.name}; expected {_FORM}")
    return engine


@contextmanager
def _alone(engine: Engine, study: str) -> Iterator[None]:
    """Hold the study until the block ends, or the process: PostgreSQL takes the lock back with the connection."""
    from sqlalchemy import text
    from sqlalchemy.exc import OperationalError

    key = {"key": int.from_bytes(hashlib.sha256(study.encode()).digest()[:8], signed=True)}
    try:
        connection = engine.connect()
    except OperationalError as error:
        where = engine.url.render_as_string(hide_password=True)
        raise StudyStoreError(
            f"{STUDY_STORE} names {where}, which cannot be reached ({in_brief(error.orig)}); correct "
            "it, or unset it to keep trials in the repository"
        ) from None
    with connection:
        if not connection.execute(text("SELECT pg_try_advisory_lock(:key)"), key).scalar():
            _log.warning("%s: another process searches the same thing; waiting for its trials", study)
            connection.execute(text("SELECT pg_advisory_lock(:key)"), key)
        yield


def _journal_storage(journal: Path) -> JournalStorage:
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    journal.parent.mkdir(parents=True, exist_ok=True)
    Path(f"{journal}.lock").unlink(missing_ok=True)  # a kill while it was written left it, and Optuna would wait for it
    if journal.is_file():
        content = journal.read_bytes()
        whole = content[: content.rfind(b"\n") + 1]
        if whole != content:  # a kill cut the last line off, which Optuna refuses
            journal.write_bytes(whole)
    return JournalStorage(JournalFileBackend(str(journal)))
