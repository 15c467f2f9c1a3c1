"""Files at the edge: read whole, written whole or not at all."""

import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from tracemesh.errors import InputError


def read_bytes(name: str) -> bytes:
    """Content of a file; `-` is standard input. Raises InputError when it cannot be read."""
    if name == "-":
        return sys.stdin.buffer.read()
    try:
        return Path(name).read_bytes()
    except OSError as error:
        raise InputError(f"{name}: cannot be read: {error.strerror}") from None


def read_text(name: str) -> str:
    """Content of a text file; `-` is standard input. Raises InputError when it is no UTF-8 text."""
    content = read_bytes(name)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{name}: wanted UTF-8 text, got byte 0x{content[error.start]:02x} at {error.start}") from None


def write_all(outputs: Mapping[Path, bytes]) -> None:
    """Write all files or none; raises InputError with the name that could not be written."""
    staged: list[tuple[Path, Path]] = []
    try:
        for path, content in outputs.items():
            part = path if _is_device(path) else path.with_name(f".{path.name}.part")
            staged.append((part, path))
            part.write_bytes(content)
        for part, path in staged:
            if part != path:
                part.replace(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
    finally:
        for part, path in staged:
            if part != path:
                with suppress(OSError):
                    part.unlink(missing_ok=True)


def check_writable(*wanted: Path | None) -> None:
    """Find out before the work what could not be written after it; raises InputError. None stands for no file."""
    paths = [path for path in wanted if path is not None and not _is_device(path)]
    for i, path in enumerate(paths):
        if path in paths[:i]:
            raise InputError(f"{path}: wanted a file of its own for each result, got this one twice")
        if not path.parent.is_dir():
            raise InputError(f"{path}: cannot be written: there is no folder {path.parent}")


def _is_device(path: Path) -> bool:
    """Such as /dev/stdout, which cannot be replaced."""
    return path.exists() and not path.is_file()
