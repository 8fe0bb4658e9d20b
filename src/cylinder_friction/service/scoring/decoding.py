"""Columns of samples from the bodies of requests: the JSON, CSV and Parquet that MLflow's server takes, and Arrow."""

from collections.abc import Callable

from cylinder_friction.deployment.scoring import RECORDING_COLUMN, shown
from cylinder_friction.service.scoring.errors import Columns, Expected, RequestError
from cylinder_friction.service.scoring.json_forms import from_json

JSON = "application/json"
CSV = "text/csv"
ARROW = "application/vnd.apache.arrow.stream"
PARQUET = "application/vnd.apache.parquet"
MAX_RECORDINGS = 1000


def decoder_of(content_type: str | None) -> Callable[[bytes, Expected], Columns]:
    """Return what decodes bodies of a media type.

    Raises:
        RequestError: 415, there is none, or it has another charset than UTF-8.
    """
    media, *parameters = [part.strip().lower() for part in (content_type or "").split(";")]
    if media not in (JSON, CSV, ARROW, PARQUET):
        got = shown(content_type) if content_type else "missing"
        raise RequestError(415, f"Content-Type is {got}; expected {JSON}, {CSV}, {ARROW} or {PARQUET}")
    for parameter in filter(None, parameters):
        if parameter.replace('"', "") not in ("charset=utf-8", "charset=utf8", "header=present"):
            raise RequestError(415, f"Content-Type has {shown(parameter)}; expected UTF-8 and no other parameter")
    if media == JSON:
        return from_json
    from cylinder_friction.service.scoring import tables  # pyarrow takes 40 MB, and JSON needs none

    return {CSV: tables.from_csv, ARROW: tables.from_arrow, PARQUET: tables.from_parquet}[media]


def refuse_too_many(columns: Columns) -> None:
    """Refuse more recordings in a request than a worker should run one by one.

    Raises:
        RequestError: 413.
    """
    names = columns.get(RECORDING_COLUMN, ())
    try:
        count = len(set(names))
    except TypeError:  # no names; the model refuses them
        return
    if count > MAX_RECORDINGS:
        raise RequestError(413, f"got {count} recordings; expected at most {MAX_RECORDINGS}; send several requests")
