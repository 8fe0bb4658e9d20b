"""The description of the routes: as OpenAPI for programs, and as a page for people that needs no network."""

import json
from pathlib import Path
from typing import Any

from cylinder_friction.deployment.scoring import OFFSET, RECORDING_COLUMN, TIME_COLUMN
from cylinder_friction.recordings.columns import in_shown_unit
from cylinder_friction.recordings.files import read_json
from cylinder_friction.service.scoring.decoding import ARROW, CSV, JSON, MAX_RECORDINGS, PARQUET
from cylinder_friction.service.scoring.errors import MAX_COLUMNS
from cylinder_friction.service.scoring.model_source import ModelInService
from cylinder_friction.service.scoring.settings import ServeSettings

Schema = dict[str, Any]

_TEMPLATES = Path(__file__).with_name("templates")
_EXAMPLE_FILE, _EXAMPLE_ROWS = "input_example.json", 5
_REFUSALS = {
    400: "The body cannot be decoded, or has a key twice.",
    401: "A known token is needed.",
    408: "The body did not arrive in time.",
    413: "The body is too large, or has too many rows or recordings.",
    415: "Another Content-Type, a Content-Encoding, or another charset than UTF-8.",
    422: "Rows that cannot be scored: a column is missing, unknown or twice, a value is no finite number.",
    429: "Too many requests at a time; Retry-After states in how many seconds to try again.",
    503: "Not scored in time, or too little memory.",
}
_OUTPUTS = {
    "friction_n": ("number", "friction [N], positive when it opposes extension"),
    "lower_n": ("number", "lower bound [N]"),
    "upper_n": ("number", "upper bound [N]"),
    "flags": ("integer", "how far to trust the row, a sum of bits; 0: fully"),
    "flag_names": ("string", "names of these bits, with spaces between them"),
    "in_training_range": ("boolean", "false: the estimate is an extrapolation"),
    "offset_n": ("number", "offset of the sensors' zeros in friction, as learned up to this row [N]"),
    "offset_uncertainty_n": ("number", "its standard uncertainty [N]"),
}
_SHOWN = {
    "/livez": "Responds while the worker runs; so do /ping and /health.",
    "/readyz": "The model in service, and how far it is from its golden trajectory.",
    "/version": "The version of MLflow, as its server gives it.",
    "/metrics": "Figures for Prometheus, over all workers.",
    "/openapi.json": "This description.",
    "/docs": "This description as a page.",
}


def openapi(now: ModelInService, settings: ServeSettings) -> Schema:
    """Return the OpenAPI description of the routes, for the inputs of the model in service."""
    binary = {"schema": {"type": "string", "format": "binary"}}
    example = _example(now)
    csv = "".join(",".join(map(str, row)) + "\n" for row in [example["columns"], *example["data"]])
    estimates = _object({"predictions": {"type": "array", "items": {"$ref": "#/components/schemas/Estimate"}}})
    limits = f"At most {settings.max_rows} rows, {MAX_RECORDINGS} recordings and {settings.max_body_bytes} bytes."
    invocations = {
        "summary": "Friction at every row.",
        "description": f"Rows of a name in {RECORDING_COLUMN} are one sequence, in their order, at the model's sample "
        f"time; without names all rows are one. {limits}",
        "parameters": [{"name": "X-Request-ID", "in": "header", "schema": {"type": "string"}}],
        "requestBody": {
            "required": True,
            "content": {
                JSON: {"schema": _forms(), "example": {"dataframe_split": example}},
                CSV: {"schema": {"type": "string"}, "example": csv},
                ARROW: binary,
                PARQUET: binary,
            },
        },
        "responses": {
            "200": {"description": "One object per row.", "content": {JSON: {"schema": estimates}, ARROW: binary}},
            **{str(status): _refusal(text) for status, text in _REFUSALS.items() if status != 401 or settings.tokens},
        },
    }
    shown = {
        path: {"get": {"summary": text, "responses": {"200": {"description": text}}}} for path, text in _SHOWN.items()
    }
    described: Schema = {
        "openapi": "3.1.0",
        "info": {
            "title": now.model.name,
            "version": now.model.version,
            "description": now.graph.trained_for and f"Trained for {now.graph.trained_for}.",
        },
        "paths": {"/invocations": {"post": invocations}, **shown},
        "components": {"schemas": _schemas(now)},
    }
    if settings.tokens:
        described["components"]["securitySchemes"] = {"token": {"type": "http", "scheme": "bearer"}}
        described["security"] = [{"token": []}]
    return described


def page(described: Schema) -> str:
    """Return an OpenAPI description as a page, with requests that can be pasted into a shell."""
    from jinja2 import Environment, FileSystemLoader

    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    content = described["paths"]["/invocations"]["post"]["requestBody"]["content"]
    body, csv = json.dumps(content[JSON]["example"]), content[CSV]["example"]
    return environment.get_template("documentation.html").render(described=described, body=body, csv=csv)


def _forms() -> Schema:
    samples = {"type": "array", "minItems": 1, "items": {"$ref": "#/components/schemas/Sample"}}
    values = {"type": "array", "items": {"type": ["number", "string"]}}
    split = _object(
        {
            "columns": {"type": "array", "items": {"type": "string"}, "uniqueItems": True, "maxItems": MAX_COLUMNS},
            "data": {"type": "array", "minItems": 1, "items": values},
        }
    )
    columns = {"type": "object", "additionalProperties": values}
    forms = {"dataframe_split": split, "dataframe_records": samples, "inputs": columns, "instances": samples}
    return {"oneOf": [_object({name: schema}) for name, schema in forms.items()]}


def _valid(column: str, lower: float, upper: float) -> str:
    """Return an input's valid range as the model card states it."""
    _, unit, low, high = in_shown_unit(column, lower, upper)
    return f"in the unit that its name states; valid from {low} to {high} {unit}, flagged beyond".replace("  ", " ")


def _schemas(now: ModelInService) -> Schema:
    graph = now.graph
    inputs: Schema = {
        name: {"type": "number", "description": _valid(name, low, high)}
        for name, low, high in zip(graph.inputs, graph.lower, graph.upper, strict=True)
    }
    optional = {
        RECORDING_COLUMN: {
            "type": ["string", "integer"],
            "minLength": 1,
            "description": "optional: name of the recording",
        },
        TIME_COLUMN: {
            "type": "number",
            "description": f"optional: time [s], checked to go on by {graph.sample_time_s:g} s",
        },
    }
    outputs = {name: {"type": kind, "description": text} for name, (kind, text) in _OUTPUTS.items()}
    for learned in set(OFFSET) - set(graph.outputs):
        del outputs[learned]
    for bound in ("lower_n", "upper_n"):
        outputs[bound]["description"] += f": {graph.bounds}"
    outputs["flags"]["description"] += "; " + ", ".join(f"{bit} {name}" for bit, name in graph.flags.items())
    refusal = {key: {"type": "string"} for key in ("error_code", "message", "request_id")}
    sample = {**_object(inputs), "properties": {**inputs, **optional}}
    return {"Sample": sample, "Estimate": _object(outputs), "Refusal": _object(refusal)}


def _object(properties: Schema) -> Schema:
    return {"type": "object", "properties": properties, "required": list(properties), "additionalProperties": False}


def _refusal(text: str) -> Schema:
    return {"description": text, "content": {JSON: {"schema": {"$ref": "#/components/schemas/Refusal"}}}}


def _example(now: ModelInService) -> dict[str, Any]:
    """Return the first rows of the example in the model's folder, or the middle of the training range."""
    path = now.model.folder / _EXAMPLE_FILE
    if path.is_file():
        content = read_json(path)
        return {"columns": content["columns"], "data": content["data"][:_EXAMPLE_ROWS]}
    return {"columns": list(now.graph.inputs), "data": [(0.5 * (now.graph.lower + now.graph.upper)).tolist()]}
