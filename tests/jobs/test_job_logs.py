"""Lines about a job say which."""

import json
import logging

from tracemesh.logs import JsonLines, TextLines, about


def record(message: str) -> logging.LogRecord:
    return logging.LogRecord("tracemesh.jobs", logging.WARNING, __file__, 1, message, (), None)


def test_lines_belong_to_the_job_or_request_of_their_block() -> None:
    with about(request="r1"):
        with about(job="j1"):
            assert json.loads(JsonLines().format(record("lost")))["job"] == "j1"
            assert TextLines().format(record("lost")).endswith("lost [request r1] [job j1]")
        line = json.loads(JsonLines().format(record('two "lines"\nin one')))
    assert (line["request"], line["message"]) == ("r1", 'two "lines"\nin one')
    assert "job" not in line
    assert TextLines().format(record("alone")).endswith(": alone")
