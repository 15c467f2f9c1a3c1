"""The durable local log of a recording: what the device said is on this disk before it goes anywhere else.

A spool is a folder. Each recording in it is a folder of its own with segments `NNNNNNNNNNNN.ndjson`, named after the
number of their first message; every segment starts with the recording's `hello`, so that each is a recording by
itself, and all together in order (hellos after the first left out) are what was sent. `staged.ndjson` holds the samples
that are not yet in a message, so that killing the bridge costs none of them.

Messages are written at once and made durable in groups (`sync`); only durable ones may be sent, so that a server can
never have a message that a power cut takes from the spool. A segment is deleted when all of it is acknowledged and
another has begun. When the disk is full, messages wait in memory, bounded, and are written once there is room.
"""

import fcntl
import os
import shutil
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from pydantic import ValidationError

from tracemesh.wire.arrays import ArrayReading
from tracemesh.wire.device import CurveStart, Hello, Recorded, Samples, from_device
from tracemesh_bridge.errors import SpoolError

SEGMENT_BYTES = 1_000_000
MAX_WAITING = 5000
"""Messages kept in memory while the disk is full: about ten minutes of a Morphorider."""
_STAGED = "staged.ndjson"


class Spool:
    """One recording on disk. One thread appends; `sync` may run in another."""

    def __init__(self, folder: Path, hello: Hello, segment_bytes: int = SEGMENT_BYTES) -> None:
        """Open the recording in `folder`, or begin it. Raises SpoolError if a file holds what no spool wrote.

        written, durable, next_seq: how many messages are on disk, there to stay, and there or waiting in memory.
        """
        self.place = folder
        self.hello = hello
        self.trouble = ""
        self._segment_bytes = segment_bytes
        self._lock = threading.Lock()
        self._waiting: deque[Recorded] = deque()
        folder.mkdir(parents=True, exist_ok=True)
        _sync_folder(folder.parent)
        self._firsts = _whole_segments(folder)
        self.first_seq = self._firsts[0] if self._firsts else 0
        self._file = -1
        self._size = 0
        self.written = self._open_last() if self._firsts else 0
        self.durable = self.next_seq = self.written
        self._staged = os.open(folder / _STAGED, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)

    def append(self, message: Recorded) -> None:
        """Write the next message. Raises SpoolError if the disk is full and too many wait already."""
        if message.seq != self.next_seq:
            raise SpoolError(f"wanted message {self.next_seq}, got {message.seq}")
        if len(self._waiting) >= MAX_WAITING:
            raise SpoolError(f"{self.trouble}; {MAX_WAITING} messages wait in memory, no more can")
        self._waiting.append(message)
        self.next_seq += 1
        self._write_waiting()

    def stage(self, samples: Samples) -> None:
        """Keep samples that will be part of a message later. They are forgotten when the next one is written."""
        if not self._waiting:
            try:
                os.write(self._staged, _line(samples))
            except OSError as error:
                self.trouble = _trouble(error)

    def staged(self) -> Iterator[Samples]:
        """What was staged before the bridge was killed, oldest first; a torn last line is left out."""
        for line in (self.place / _STAGED).read_bytes().splitlines(keepends=True):
            message = _message(line)
            if isinstance(message, Samples):
                yield message

    def sync(self) -> None:
        """Make everything written so far durable; waiting messages are tried again first."""
        self._write_waiting()
        with self._lock:
            reached, file = self.written, os.dup(self._file) if self._file >= 0 else -1
        if file < 0:
            return
        try:
            if self.durable < reached:
                os.fsync(file)  # not under the lock: a slow disk must not hold up who appends
                self.durable = max(self.durable, reached)
        finally:
            os.close(file)

    def acknowledge(self, seq: int) -> None:
        """The server has everything up to and including `seq`: delete the segments that hold nothing else."""
        while len(self._firsts) > 1 and self._firsts[1] <= seq + 1:
            self._path(self._firsts.pop(0)).unlink()
            self.first_seq = self._firsts[0]

    def tail(self) -> Iterator[Recorded]:
        """The messages of the newest segment: enough to know where the recording stands."""
        if self._firsts:
            with self._path(self._firsts[-1]).open("rb") as lines:
                yield from (m for m in map(_message, lines) if m is not None and not isinstance(m, Hello))

    def lines(self, seq: int) -> "Cursor":
        """A cursor that stands before message `seq`."""
        return Cursor(self._segments_from(seq), seq, lambda: self.durable)

    def close(self) -> None:
        """Make everything durable, if the disk lets us, and let go of the files."""
        try:
            self.sync()
        except OSError as error:
            self.trouble = _trouble(error)
        for file in (self._file, self._staged):
            if file >= 0:
                os.close(file)
        self._file = self._staged = -1

    def delete(self) -> None:
        """Remove the recording: the server has it all."""
        self.close()
        shutil.rmtree(self.place)

    def _path(self, first: int) -> Path:
        return self.place / f"{first:012d}.ndjson"

    def _segments_from(self, seq: int) -> Callable[[int], Path]:
        if seq < self.first_seq:
            raise SpoolError(f"message {seq} was deleted; the oldest kept in {self.place} is {self.first_seq}")
        return lambda wanted: self._path(max(f for f in self._firsts if f <= wanted))

    def _open_last(self) -> int:
        path = self._path(self._firsts[-1])
        with path.open("rb") as lines:
            count = sum(1 for _ in lines) - 1
            self._size = lines.tell()
        self._file = os.open(path, os.O_WRONLY | os.O_APPEND)
        os.fsync(self._file)
        return self._firsts[-1] + count

    def _write_waiting(self) -> None:
        with self._lock:
            try:
                while self._waiting:
                    self._write(self._waiting[0])
                    if isinstance(self._waiting.popleft(), Samples):
                        os.ftruncate(self._staged, 0)
                self.trouble = ""
            except OSError as error:
                self.trouble = _trouble(error)

    def _write(self, message: Recorded) -> None:
        # A segment must start with a message from which a restart can go on: one that says how many samples there are.
        restartable = isinstance(message, Samples | CurveStart | ArrayReading)
        if self._file < 0 or (self._size >= self._segment_bytes and restartable):
            self._begin_segment(message.seq)
        self._write_line(_line(message))
        self.written += 1

    def _begin_segment(self, first: int) -> None:
        if self._file >= 0:
            os.fsync(self._file)
            self.durable = self.written
        path = self._path(first)
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND, 0o600)
        try:
            _write_all(file, _line(self.hello))
            _sync_folder(self.place)
        except OSError:
            os.close(file)
            path.unlink(missing_ok=True)
            raise
        if self._file >= 0:
            os.close(self._file)
        self._file, self._size = file, os.fstat(file).st_size
        self._firsts.append(first)

    def _write_line(self, line: bytes) -> None:
        try:
            _write_all(self._file, line)
        except OSError:
            os.ftruncate(self._file, self._size)
            raise
        self._size += len(line)


class Cursor:
    """Reads a spool's durable messages as they were written, one line each, following it as it grows."""

    def __init__(self, segment: Callable[[int], Path], seq: int, durable: Callable[[], int]) -> None:
        """`segment` finds the file that holds a message; `durable` tells how many messages may be read."""
        self.seq = seq
        self._segment = segment
        self._durable = durable
        self._lines: Iterator[bytes] = iter(())

    def next(self) -> str | None:
        """The next message's line, or None if there is none yet."""
        if self.seq >= self._durable():
            return None
        line = next(self._lines, b"")
        if not line:
            self._lines = self._from(self.seq)
            line = next(self._lines)
        self.seq += 1
        return line.decode().rstrip("\n")

    def _from(self, seq: int) -> Iterator[bytes]:
        path = self._segment(seq)
        with path.open("rb") as file:
            for number, line in enumerate(file, start=int(path.stem) - 1):
                if number >= seq:
                    yield line


@contextmanager
def exclusive(root: Path) -> Iterator[None]:
    """Hold a folder of spools for oneself. Raises SpoolError if another bridge has it, or it cannot be written."""
    try:
        root.mkdir(parents=True, exist_ok=True)
        file = os.open(root / "lock", os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as error:
        raise SpoolError(f"cannot use {root} as a spool: {error.strerror}") from error
    try:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise SpoolError(f"another bridge uses {root}; give this one a folder of its own: --spool") from error
        yield
    finally:
        os.close(file)


def open_spools(root: Path, wanted: Hello) -> tuple[Spool, list[Spool]]:
    """The spool to record into and those left over from before, which only need sending.

    A recording of the same device, set up the same, for the same session is continued; `wanted` begins a new one
    otherwise. Raises SpoolError.
    """
    current: Spool | None = None
    left_over: list[Spool] = []
    for folder in sorted(root.iterdir()) if root.is_dir() else ():
        hello = _hello_of(folder)
        if hello is None:
            continue
        spool = Spool(folder, hello)
        if current is None and hello.model_copy(update={"recording": wanted.recording}) == wanted:
            current = spool
        else:
            left_over.append(spool)
    return current or Spool(root / wanted.recording, wanted), left_over


def _hello_of(folder: Path) -> Hello | None:
    firsts = _whole_segments(folder) if folder.is_dir() else []
    if not firsts:
        return None
    with (folder / f"{firsts[0]:012d}.ndjson").open("rb") as file:
        hello = _message(file.readline())
    if not isinstance(hello, Hello):
        raise SpoolError(f"{folder}: wanted a recording that begins with hello; move it away to go on")
    return hello


def _whole_segments(folder: Path) -> list[int]:
    """Numbers of the segments' first messages, after cutting off what a crash tore from the newest."""
    firsts = sorted(int(p.stem) for p in folder.glob("*.ndjson") if p.stem.isdigit())
    if firsts:
        newest = folder / f"{firsts[-1]:012d}.ndjson"
        if _cut_torn_tail(newest, firsts[-1]) == 0:
            newest.unlink()
            firsts.pop()
    return firsts


def _cut_torn_tail(path: Path, first: int) -> int:
    """Cut off what a crash tore at the end; returns how many messages follow the hello.

    Raises SpoolError if something unreadable is followed by a message: no crash leaves that behind.
    """
    lines = path.read_bytes().splitlines(keepends=True)
    good = 0
    while good < len(lines) and _is_line(good, first, _message(lines[good])):
        good += 1
    if any(_message(line) is not None for line in lines[good:]):
        wanted = f"message {first + good - 1}" if good else "hello"
        raise SpoolError(f"{path}: line {good + 1}: wanted {wanted}; move the file away to go on")
    os.truncate(path, sum(map(len, lines[:good])))
    return max(good - 1, 0)


def _is_line(number: int, first: int, message: Hello | Recorded | None) -> bool:
    if number == 0 or message is None or isinstance(message, Hello):
        return number == 0 and isinstance(message, Hello)
    return message.seq == first + number - 1


def _message(line: bytes) -> Hello | Recorded | None:
    if not line.endswith(b"\n"):
        return None
    try:
        return from_device.validate_json(line)
    except ValidationError:
        return None


def _line(message: Hello | Recorded) -> bytes:
    return message.model_dump_json(exclude_none=True).encode() + b"\n"


def _write_all(file: int, data: bytes) -> None:
    while data:
        data = data[os.write(file, data) :]


def _sync_folder(folder: Path) -> None:
    file = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(file)
    finally:
        os.close(file)


def _trouble(error: OSError) -> str:
    return f"cannot write the spool: {error.strerror}"
