"""docker-compose.yml: the server alone by default, and in every profile whatever its services need."""

from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]

COMPOSE = yaml.safe_load((Path(__file__).resolve().parents[2] / "docker-compose.yml").read_text())


def services(*profiles: str) -> dict[str, Any]:
    """Those that `docker compose --profile ...` would start."""
    all_of_them = COMPOSE["services"].items()
    return {name: s for name, s in all_of_them if not s.get("profiles") or set(s["profiles"]) & set(profiles)}


@pytest.mark.parametrize(
    ("profiles", "wanted"),
    [
        ((), {"server"}),
        (("team",), {"server", "postgres", "s3", "bucket"}),
        (("team", "cluster"), {"server", "postgres", "s3", "bucket", "scheduler", "worker"}),
    ],
)
def test_a_profile_has_what_its_services_need(profiles: tuple[str, ...], wanted: set[str]) -> None:
    found = services(*profiles)
    assert found.keys() == wanted
    for service in found.values():
        assert set(service.get("depends_on", ())) <= wanted
        assert {volume.split(":")[0] for volume in service.get("volumes", ())} <= COMPOSE["volumes"].keys()


@pytest.mark.parametrize("name", COMPOSE["services"])
def test_what_is_ours_runs_closed_in(name: str) -> None:
    service = COMPOSE["services"][name]
    if service["image"] != "tracemesh":
        assert ":" in service["image"], "wanted a version of somebody else's image"
        return
    assert (service["read_only"], service["cap_drop"]) == (True, ["ALL"])
    assert service["environment"]["TRACEMESH_TOKEN"].startswith("${TRACEMESH_TOKEN:?")
    assert "healthcheck" in service or name == "server", "the image's own check asks for the server's page"
