"""An S3-compatible bucket. Credentials, region and endpoint come from the usual `AWS_...` variables."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime, timedelta
from functools import cached_property
from typing import TYPE_CHECKING

from tracemesh.errors import NotFound, ResourceError, Unavailable

if TYPE_CHECKING:
    from obstore.store import S3Store

PATIENCE = timedelta(seconds=10)
"""How long a request is tried again before the bucket counts as away."""


class Bucket:
    """Contents by name, under a URL such as s3://bucket/prefix."""

    def __init__(self, url: str) -> None:
        """Nothing is asked of the bucket yet."""
        self.url = url

    def put(self, name: str, content: bytes) -> None:
        """Store, whole or not at all; what was there is replaced. Raises Unavailable."""
        with self._open() as store:
            store.put(name, content)

    def get(self, name: str) -> bytes:
        """The content; raises NotFound or Unavailable."""
        with self._open() as store:
            return bytes(store.get(name).bytes())

    def names(self, until: datetime) -> list[str]:
        """Names of everything that was stored last before `until`. Raises Unavailable."""
        with self._open() as store:
            return [found["path"] for page in store.list() for found in page if found["last_modified"] < until]

    def remove(self, names: list[str]) -> None:
        """Delete; raises Unavailable."""
        with self._open() as store:
            if names:
                store.delete(names)

    @cached_property
    def _store(self) -> "S3Store":
        try:
            from obstore.store import S3Store
        except ImportError:
            raise ResourceError(f"{self.url} wants another package: pip install 'tracemesh[s3]'") from None
        unencrypted = os.environ.get("AWS_ENDPOINT_URL", "").startswith("http://")
        return S3Store.from_url(
            self.url,
            client_options={"allow_http": unencrypted, "timeout": PATIENCE},
            retry_config={"max_retries": 3, "retry_timeout": PATIENCE},
        )

    @contextmanager
    def _open(self) -> Iterator["S3Store"]:
        """The library's errors span many lines; the first one says it."""
        store = self._store
        from obstore.exceptions import BaseError

        try:
            yield store
        except FileNotFoundError:
            raise NotFound(f"{self.url} has no such content") from None
        except (BaseError, OSError) as error:
            raise Unavailable(f"the bucket {self.url} cannot be used: {str(error).splitlines()[0]}") from None
