"""Conditional requests: nothing is sent that is known already, and nobody overwrites what he has not seen."""

from hashlib import sha256
from typing import Annotated, TypeVar

from fastapi import Depends, Header, HTTPException, Response
from pydantic import BaseModel

from tracemesh.errors import Changed

Thing = TypeVar("Thing", bound=BaseModel)


class Conditions:
    """What a request says of the state that its sender knows, by the ETag that came with it."""

    def __init__(
        self,
        response: Response,
        if_match: Annotated[str, Header(description="only if this ETag is still right: else 412")] = "",
        if_none_match: Annotated[str, Header(description="only if this ETag is not right any more: else 304")] = "",
    ) -> None:
        """As in the request's headers."""
        self._response = response
        self._if_match = if_match
        self._if_none_match = if_none_match

    def answer(self, thing: Thing) -> Thing:
        """The thing with its ETag; raises HTTPException 304 when the sender has it."""
        tag = tag_of(thing)
        if _matches(tag, self._if_none_match):
            raise HTTPException(304, headers={"ETag": tag})
        self._response.headers["ETag"] = tag
        return thing

    def demand(self, present: BaseModel) -> None:
        """Raise Changed when the sender knows another state than this one."""
        if self._if_match and not _matches(tag_of(present), self._if_match):
            raise Changed(f"it has changed meanwhile: wanted If-Match {tag_of(present)}, got {self._if_match}")


UseConditions = Annotated[Conditions, Depends()]


def tag_of(thing: BaseModel) -> str:
    """ETag of a thing: the same as long as it says the same."""
    return f'"{sha256(thing.model_dump_json().encode()).hexdigest()[:32]}"'


def _matches(tag: str, header: str) -> bool:
    """Weak tags too: compression weakens them, and what they stand for is the state, not the bytes."""
    given = [part.strip().removeprefix("W/") for part in header.split(",")]
    return tag in given or "*" in given
