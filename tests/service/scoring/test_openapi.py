"""The description of the routes: its examples work, nothing in it needs a network, and random requests made from it."""

import json
import re
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from cylinder_friction.service.scoring.decoding import CSV, JSON


def references(node: Any) -> Iterator[str]:
    for value in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        yield from references(value)
    if isinstance(node, dict) and "$ref" in node:
        yield node["$ref"]


def test_the_description_is_whole_and_its_examples_are_scored(server: Any) -> None:
    described = server.get("/openapi.json").json()
    assert described["openapi"] == "3.1.0"
    schemas = described["components"]["schemas"]
    assert {*references(described)} == {f"#/components/schemas/{name}" for name in schemas}
    content = described["paths"]["/invocations"]["post"]["requestBody"]["content"]
    scored = [server.ask(content[JSON]["example"]), server.ask(content[CSV]["example"].encode(), CSV)]
    assert [reply.status for reply in scored] == [200, 200]
    (row,) = scored[0].json()["predictions"]
    assert [*row] == [*schemas["Estimate"]["properties"]]
    assert {*schemas["Sample"]["required"]} == {"pressure_1_pa", "pressure_2_pa", "position_m"}
    stated = schemas["Sample"]["properties"]["pressure_1_pa"]["description"]
    assert re.search(r"valid from -?[\d.]+ to [\d.]+ bar, flagged beyond$", stated)  # in the words of the model card
    for path, methods in described["paths"].items():
        assert "get" not in methods or server.get(path).status == 200


def test_the_page_shows_a_request_that_works_and_loads_nothing(
    serve: Callable[..., AbstractContextManager[Any]], model_folder: Path, current: Path
) -> None:
    example = {"columns": ["pressure_1_pa", "pressure_2_pa", "position_m"], "data": [[578900.0, 732421.0, 0.17]]}
    path = model_folder / "input_example.json"
    path.write_text(json.dumps(example))
    try:
        with serve() as server:
            reply = server.get("/docs")
    finally:
        path.unlink()
    text = reply.body.decode().replace("&#34;", '"')
    assert reply.headers["content-type"] == "text/html; charset=utf-8"
    assert json.dumps({"dataframe_split": example}) in text
    assert "578900.0,732421.0,0.17\n" in text
    assert not re.search(r"(src|href)=.?(https?:)?//", text)
    assert "Authorization" not in text


def test_the_description_names_tokens_where_they_are_needed(
    serve: Callable[..., AbstractContextManager[Any]], tmp_path: Path
) -> None:
    (tmp_path / "tokens").write_text("ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad")  # of abc
    with serve(tokens=tmp_path / "tokens") as server:
        described = server.get("/openapi.json", {"Authorization": "Bearer abc"}).json()
        assert described["security"] == [{"token": []}]
        assert "401" in described["paths"]["/invocations"]["post"]["responses"]
        page = server.get("/docs", {"Authorization": "Bearer abc"}).body
        assert b"Authorization: Bearer TOKEN" in page.replace(b"&#39;", b"")
