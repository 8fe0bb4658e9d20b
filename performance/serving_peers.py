"""What the served model is compared with: a minimal FastAPI application with the same graph.

``serving_load.py`` starts it; it finds its graph through the environment variable ``GRAPH``.
"""

import io
import os
from typing import Any

import numpy as np
import onnxruntime
import pyarrow as pa
from fastapi import FastAPI, Request, Response
from pydantic import BaseModel


class Table(BaseModel):
    """Rows as MLflow's ``dataframe_split`` has them."""

    columns: list[str]
    data: list[list[float]]


class Body(BaseModel):
    """A request."""

    dataframe_split: Table


class Row(BaseModel):
    """What is estimated for one row."""

    friction_n: float
    lower_n: float
    upper_n: float
    flags: int


class Predictions(BaseModel):
    """A response."""

    predictions: list[Row]


def application() -> FastAPI:
    """Return the application: what one writes in an hour who trusts what is sent."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(os.environ["GRAPH"], options, providers=["CPUExecutionProvider"])
    names = list(Row.model_fields)
    given = {port.name: np.zeros((1, 2)) for port in session.get_inputs() if port.name == "offset"}
    app = FastAPI()

    @app.get("/ping")
    async def ping() -> str:
        return "ready"

    @app.post("/invocations")
    async def invocations(body: Body) -> Predictions:
        columns = session.run(names, {"samples": np.array(body.dataframe_split.data), **given})
        rows = zip(*(column.tolist() for column in columns), strict=True)
        return Predictions.model_construct(
            predictions=[Row.model_construct(**dict(zip(names, row, strict=True))) for row in rows]
        )

    @app.post("/arrow")
    async def arrow(request: Request) -> Response:
        with pa.ipc.open_stream(await request.body()) as reader:
            table = reader.read_all()
        samples = np.stack([column.to_numpy() for column in table.columns], axis=1)
        columns: list[Any] = session.run(names, {"samples": samples, **given})
        result, sink = pa.table(dict(zip(names, columns, strict=True))), io.BytesIO()
        with pa.ipc.new_stream(sink, result.schema) as writer:
            writer.write_table(result)
        return Response(sink.getvalue(), media_type="application/vnd.apache.arrow.stream")

    return app
