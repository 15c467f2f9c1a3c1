"""How long lists are answered: a page, and in the `Link` header the address of the next one."""

from collections.abc import Callable, Sequence
from typing import Annotated, TypeVar
from urllib.parse import urlencode

from fastapi import Depends, Query, Request, Response

from tracemesh.errors import InputError
from tracemesh.wire.base import Identifier

T = TypeVar("T")
MOST = 500
"""Things on one page."""
MOST_DIGITS = 10
"""Of a number: more than anything has, less than a database's integer."""


class Page:
    """What of a list is wanted."""

    def __init__(
        self,
        request: Request,
        response: Response,
        limit: Annotated[int, Query(ge=1, le=MOST, description="most things on the page")] = 100,
        after: Annotated[Identifier | None, Query(description="last thing of the page before")] = None,
    ) -> None:
        """As asked for in the address."""
        self._request = request
        self._response = response
        self._limit = limit
        self.after = after

    @property
    def first(self) -> int:
        """Least number to look for in a list whose things are called 0, 1, 2, ...; raises InputError."""
        if self.after is not None and not (self.after.isdecimal() and len(self.after) < MOST_DIGITS):
            raise InputError(f"wanted after=NUMBER, got {self.after}")
        return 0 if self.after is None else int(self.after) + 1

    @property
    def window(self) -> slice:
        """What to look for in such a list; raises InputError."""
        return slice(self.first, self.first + self.limit)

    @property
    def limit(self) -> int:
        """How many to look for: one more than wanted tells whether there is a next page."""
        return self._limit + 1

    def of(self, found: Sequence[T], name: Callable[[T], object]) -> list[T]:
        """The page, of what was found; `name` is what a thing is called in `after`."""
        if len(found) > self._limit:
            query = {**self._request.query_params, "limit": self._limit, "after": name(found[self._limit - 1])}
            self._response.headers["Link"] = f'<{self._request.url.path}?{urlencode(query)}>; rel="next"'
        return list(found[: self._limit])


UsePage = Annotated[Page, Depends()]
