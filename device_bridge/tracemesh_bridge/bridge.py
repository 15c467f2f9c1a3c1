"""Runs a source, an operator, a spool and its uplink together until the operator quits."""

import asyncio
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, NoReturn

from tracemesh.wire.arrays import ArrayReading
from tracemesh_bridge.console import Console, typed
from tracemesh_bridge.errors import OperatorMistake, SpoolError
from tracemesh_bridge.health import Host
from tracemesh_bridge.keys import KEYS_HELP, Command, Discard, EndCurve, KeyParser, MarkNode, Quit, StartCurve, Undo
from tracemesh_bridge.recorder import Recorder
from tracemesh_bridge.source import Reading, Source
from tracemesh_bridge.spool import Spool
from tracemesh_bridge.uplink import Uplink

TICK = 0.1
"""s between two groups of messages made durable and sent: what a sample may wait for others."""
ARRAY_TICK = 0.02
"""The same for an array: its readings are looked at one by one."""


class Bridge:
    """One device, recorded into one spool, which is uploaded while it grows."""

    def __init__(self, source: Source, spool: Spool, uplink: Uplink, host: Host, console: Console) -> None:
        """`uplink` sends `spool`; `source` tells `host` how it does."""
        self._source = source
        self._spool = spool
        self._uplink = uplink
        self._host = host
        self._console = console
        self._recorder = Recorder(spool)
        self._of_array = spool.hello.device.array is not None
        self._keys = KeyParser()
        self._stop = asyncio.Event()
        self._interrupted = asyncio.Event()
        self._failure: BaseException | None = None
        self._trouble = ""

    async def run(self) -> bool:
        """Record until the operator quits or a signal comes; whether the server then has everything.

        Quitting ends the curve and waits for the server; a signal leaves both for the next start. Raises
        what the source cannot recover from.
        """
        self._greet()
        background = [asyncio.ensure_future(work) for work in (self._uplink.run(), self._keep_durable())]
        for task in background:
            task.add_done_callback(self._ended)
        with self._signals(), typed(asyncio.get_running_loop(), self._press):
            await self._read_source()
            if not self._interrupted.is_set():
                await self._send_rest()
        for task in background:
            task.cancel()
        await asyncio.gather(*background, return_exceptions=True)
        return self._close()

    def _ended(self, task: asyncio.Future[Any]) -> None:
        """What must run for ever has failed: stop, leave everything to the next start, and say why."""
        if not task.cancelled():
            self._failure = task.exception()
            self._interrupt()

    def _interrupt(self) -> None:
        self._interrupted.set()
        self._stop.set()

    async def _read_source(self) -> None:
        loop, stop = asyncio.get_running_loop(), threading.Event()

        def read() -> None:
            try:
                for reading in self._source.readings(stop):
                    # the device is asked again only when this is on disk: a kill costs one answer at most
                    asyncio.run_coroutine_threadsafe(self._take(reading), loop).result()
            except Exception as error:  # whatever it is, the operator must hear of it
                self._failure = error
            loop.call_soon_threadsafe(self._stop.set)

        thread = threading.Thread(target=read)
        thread.start()
        await self._stop.wait()
        stop.set()
        await asyncio.to_thread(thread.join)

    async def _send_rest(self) -> None:
        with suppress(SpoolError):
            if self._recorder.progress.open:
                self._console.say(self._recorder.end(closed=False))
        if self._uplink.acknowledged < self._spool.next_seq:
            self._console.say("sending the rest; Ctrl-C leaves it in the spool for the next start")
        sent = asyncio.ensure_future(self._uplink.finished_or_refused())
        interrupted = asyncio.ensure_future(self._interrupted.wait())
        await asyncio.wait((sent, interrupted), return_when=asyncio.FIRST_COMPLETED)
        if sent.done():
            self._failure = sent.exception() or self._failure
        for task in (sent, interrupted):
            task.cancel()

    def _close(self) -> bool:
        with suppress(SpoolError):
            self._recorder.flush()
        complete = self._uplink.acknowledged == self._spool.next_seq
        if complete and not self._recorder.progress.open:
            self._spool.delete()
        else:
            self._spool.close()
            waiting = self._spool.written - self._uplink.acknowledged
            self._console.say(f"{waiting} messages wait in {self._spool.place}; the next start goes on there")
        if self._spool.next_seq > self._spool.written:
            unwritten = self._spool.next_seq - self._spool.written
            self._console.say(f"{unwritten} messages were lost: {self._spool.trouble}")
        if self._recorder.lost:
            self._console.say(f"{self._recorder.lost} samples were lost: there was no room for them")
        if self._failure:
            raise self._failure
        return complete

    async def _keep_durable(self) -> NoReturn:
        while True:
            try:
                self._recorder.flush()
                await asyncio.to_thread(self._spool.sync)
            except (SpoolError, OSError) as error:
                self._spool.trouble = str(error)
            self._tell_trouble()
            self._uplink.wake()
            self._console.status(self._status)
            await asyncio.sleep(ARRAY_TICK if self._of_array else TICK)

    async def _take(self, reading: Reading | ArrayReading) -> None:
        with suppress(SpoolError):  # counted by the recorder, told by _keep_durable
            self._recorder.add(reading)

    def _press(self, text: str) -> None:
        for command in self._keys.feed(text):
            if self._stop.is_set():
                return
            try:
                self._console.say(self._obey(command))
            except (OperatorMistake, SpoolError) as mistake:
                self._console.say(f"\a{mistake}")

    def _obey(self, command: Command) -> str:
        match command:
            case StartCurve(boundary):
                return self._recorder.start(boundary)
            case EndCurve(closed):
                return self._recorder.end(closed)
            case MarkNode(node):
                return self._recorder.mark(node)
            case Undo():
                return self._recorder.undo()
            case Discard():
                return self._recorder.discard()
            case Quit():
                self._stop.set()
                return "quitting"
            case _:
                return KEYS_HELP

    def _greet(self) -> None:
        progress = self._recorder.progress
        if self._of_array:
            self._console.say(
                f"recording {self._spool.hello.recording}, from reading {self._spool.next_seq} on; q quits"
            )
            return
        if progress.open:
            self._console.say(f"going on with curve {progress.curve} after {progress.samples} samples")
        elif self._spool.next_seq:
            self._console.say(f"going on with recording {self._spool.hello.recording}, next is curve {progress.curve}")
        self._console.say(KEYS_HELP)

    def _tell_trouble(self) -> None:
        if self._spool.trouble != self._trouble:
            self._trouble = self._spool.trouble
            self._console.say(f"spool: {self._trouble or 'writes again, nothing it had taken was lost'}")

    def _status(self) -> str:
        waiting = self._spool.next_seq - self._uplink.acknowledged
        return (
            f"{self._host.health.describe(self._host.clock.now())} | {self._recorded()} | {waiting} to send "
            f"| {self._keys.digits}"
        )

    def _recorded(self) -> str:
        progress = self._recorder.progress
        if self._of_array:
            return f"{self._spool.next_seq} readings"
        nodes = " ".join(str(node) for _, node in progress.marks)
        return (
            f"curve {progress.curve}: {progress.samples} samples, nodes {nodes or '-'}" if progress.open else "no curve"
        )

    @contextmanager
    def _signals(self) -> Iterator[None]:
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self._interrupt)
        try:
            yield
        finally:
            for number in (signal.SIGINT, signal.SIGTERM):
                loop.remove_signal_handler(number)


async def upload(spool: Spool, uplink: Uplink) -> None:
    """Send a recording that was left over to its end, then remove it."""
    sending = asyncio.ensure_future(uplink.run())
    try:
        await uplink.finished()
        spool.delete()
    finally:
        sending.cancel()
        await asyncio.gather(sending, return_exceptions=True)
