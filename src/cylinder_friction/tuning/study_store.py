"""The storage of a study's finished trials: a journal in the repository, or a team's PostgreSQL database.

An environment variable chooses the storage, not a parameter: trials are the same bit for bit in both, so another
storage must make no stage run again.
"""

import os
from pathlib import Path

from optuna.storages import BaseStorage, JournalStorage, RDBStorage
from optuna.storages.journal import JournalFileBackend
from sqlalchemy import make_url
from sqlalchemy.exc import ArgumentError, OperationalError

from cylinder_friction.extras import not_installed
from cylinder_friction.refusal import RefusalError
from cylinder_friction.wording import in_brief

STUDY_STORE = "CYLINDER_FRICTION_STUDY_STORE"
"""Environment variable: URL of the database, ``postgresql+psycopg2://...``; without it the journal is used."""
_FORM = "postgresql+psycopg2://USER@HOST/DATABASE"
_CONNECT_TIMEOUT_S = 5


class StudyStoreError(RefusalError):
    """The database for the trials cannot be used."""


def study_storage(journal: Path) -> tuple[BaseStorage, str]:
    """Open the storage of a study: its journal, or the database in its place; return it with the study's name.

    In a database the study has the name of the journal's folder, a hash of what the trials depend on: clones that run
    the same search share its trials.

    Raises:
        StudyStoreError: The database cannot be used.
    """
    url = os.environ.get(STUDY_STORE)
    return (_database(url), journal.parent.name) if url else (_journal_storage(journal), "tuning")


def _database(url: str) -> BaseStorage:
    try:
        if (kind := make_url(url).get_backend_name()) != "postgresql":
            raise StudyStoreError(f"{STUDY_STORE} names a database of {kind}; expected {_FORM}")
        return RDBStorage(url, {"connect_args": {"connect_timeout": _CONNECT_TIMEOUT_S}})
    except ArgumentError:
        raise StudyStoreError(f"{STUDY_STORE} is no URL of a database; expected {_FORM}") from None
    except ImportError as error:
        needed = not_installed(str(getattr(error.__cause__, "name", error.name)), "postgres")
        raise StudyStoreError(f"{STUDY_STORE} needs {needed}, and write {_FORM}") from None
    except OperationalError as error:
        where = make_url(url).render_as_string(hide_password=True)
        raise StudyStoreError(
            f"{STUDY_STORE} names {where}, which cannot be reached ({in_brief(error.orig)}); correct "
            "it, or unset it to keep trials in the repository"
        ) from None


def _journal_storage(journal: Path) -> JournalStorage:
    journal.parent.mkdir(parents=True, exist_ok=True)
    Path(f"{journal}.lock").unlink(missing_ok=True)  # left by a kill during a write; Optuna would wait for it
    if journal.is_file():
        content = journal.read_bytes()
        whole = content[: content.rfind(b"\n") + 1]
        if whole != content:  # a kill cut the last line off, which Optuna refuses
            journal.write_bytes(whole)
    return JournalStorage(JournalFileBackend(str(journal)))
