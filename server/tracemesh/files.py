"""Files at the edge: read whole, written whole or not at all."""

import sys
from collections.abc import Mapping
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
    """Write all files or none; raises OSError with the name that could not be written."""
    staged: list[tuple[Path, Path]] = []
    try:
        for path, content in outputs.items():
            part = path if _is_device(path) else path.with_name(f".{path.name}.part")
            staged.append((part, path))
            part.write_bytes(content)
        for part, path in staged:
            if part != path:
                part.replace(path)
    finally:
        for part, path in staged:
            if part != path:
                part.unlink(missing_ok=True)


def _is_device(path: Path) -> bool:
    """Such as /dev/stdout, which cannot be replaced."""
    return path.exists() and not path.is_file()
