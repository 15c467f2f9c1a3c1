"""Print the JSON Schema of every message that the browser needs; its TypeScript types are generated from it.

python -m tracemesh.wire.schema
"""

import json
import sys

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from tracemesh.wire import access, arrays, calibration, device, live, resources


def browser_schema() -> dict[str, object]:
    """One JSON Schema document (2020-12) whose $defs hold all wire models, as they look when serialised."""
    models: list[type[BaseModel]] = sorted(
        {
            m
            for module in (access, arrays, calibration, device, live, resources)
            for m in vars(module).values()
            if isinstance(m, type) and issubclass(m, BaseModel) and m.__module__ == module.__name__
        },
        key=lambda m: m.__name__,
    )
    _, schema = models_json_schema([(m, "serialization") for m in models], title="Wire")
    return {**schema, "type": "object", "properties": {}, "additionalProperties": False}


if __name__ == "__main__":
    json.dump(browser_schema(), sys.stdout, indent=1, sort_keys=True)
    sys.stdout.write("\n")
