"""Every route is described with an example, and every example is true to its model."""

import json
from collections.abc import Iterator
from typing import Any

import pytest

from tracemesh.api.app import create_app
from tracemesh.api.described import EXAMPLES
from tracemesh.settings import Settings
from tracemesh.wire import access, calibration, live, resources

DOCUMENT = create_app(Settings()).openapi()
SCHEMAS = json.loads(EXAMPLES.read_text())["schemas"]
OPERATIONS = [(f"{m} {path}", op) for path, ops in DOCUMENT["paths"].items() for m, op in ops.items()]


def contents(operation: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """What goes in, and what comes out when all is well."""
    yield from operation.get("requestBody", {}).get("content", {}).values()
    for status, response in operation["responses"].items():
        if status.startswith("2"):
            yield from response.get("content", {}).values()


def has_example(content: dict[str, Any]) -> bool:
    schema = content.get("schema", {})
    schema = schema.get("items", schema)
    for part in [schema, *schema.get("anyOf", [])]:
        if "$ref" in part and "examples" in DOCUMENT["components"]["schemas"][part["$ref"].rsplit("/", 1)[1]]:
            return True
    return "example" in content


@pytest.mark.parametrize(("name", "operation"), OPERATIONS, ids=[name for name, _ in OPERATIONS])
def test_every_route_has_examples_of_its_path_and_of_all_bodies(name: str, operation: dict[str, Any]) -> None:
    assert all(has_example(content) for content in contents(operation))
    for parameter in operation.get("parameters", []):
        if parameter["in"] == "path":
            assert "example" in parameter or "enum" in parameter["schema"], parameter["name"]


@pytest.mark.parametrize("name", SCHEMAS)
def test_examples_are_true_to_their_models(name: str) -> None:
    (model,) = {getattr(module, name) for module in (access, calibration, live, resources) if hasattr(module, name)}
    model.model_validate(SCHEMAS[name])
    assert name in DOCUMENT["components"]["schemas"], "nothing needs this example any more"
