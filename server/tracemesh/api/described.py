"""The API's own description, with an example of everything that goes in and comes out (examples.json)."""

import json
from pathlib import Path
from typing import Any

from fastapi import FastAPI

EXAMPLES = Path(__file__).with_name("examples.json")


class DescribedApi(FastAPI):
    """An application whose OpenAPI document has examples."""

    def openapi(self) -> dict[str, Any]:
        """The document."""
        if self.openapi_schema is None:
            _add_examples(super().openapi(), json.loads(EXAMPLES.read_text("utf-8")))
        assert self.openapi_schema is not None
        return self.openapi_schema


def _add_examples(document: dict[str, Any], examples: dict[str, dict[str, Any]]) -> None:
    """`schemas` by the model's name, `parameters` by theirs, `files` by media type."""
    for name, example in examples["schemas"].items():
        if name in document["components"]["schemas"]:
            document["components"]["schemas"][name]["examples"] = [example]
    for operations in document["paths"].values():
        for operation in operations.values():
            for parameter in operation.get("parameters", []):
                if parameter["name"] in examples["parameters"]:
                    parameter["example"] = examples["parameters"][parameter["name"]]
            bodies = [operation.get("requestBody", {}), *operation["responses"].values()]
            for media_type, content in ((m, c) for body in bodies for m, c in body.get("content", {}).items()):
                if content.get("schema", {}).get("type") == "string" and media_type in examples["files"]:
                    content["example"] = examples["files"][media_type]
