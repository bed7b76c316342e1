"""A network gateway between a client and a simulated device, whose connections can die without a sign."""

import asyncio
import contextlib
import threading


class Gateway:
    """A context manager that forwards every connection to `port` of this machine. Its attribute `port` is its own port.

    `hang_up()`: the gateway closes the present connections, in order.
    `strand()`: the present connections die in both directions, and no end is told; new connections work.
    `freeze()`: no byte passes until `thaw()`; connections are still accepted, as by a kernel.
    """

    def __init__(self, target_port):
        self.accepted = 0
        self._target_port = target_port
        self._stranded = 0
        self._near = []

    def __enter__(self):
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()))
        self._started = threading.Event()
        self._thread.start()
        self._started.wait()
        return self

    def __exit__(self, *exception):
        self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join()

    def hang_up(self):
        for writer in self._near:
            self._loop.call_soon_threadsafe(writer.close)

    def strand(self):
        self._stranded = self.accepted

    def freeze(self):
        self._loop.call_soon_threadsafe(self._thawed.clear)

    def thaw(self):
        self._loop.call_soon_threadsafe(self._thawed.set)

    async def _serve(self):
        self._loop = asyncio.get_running_loop()
        self._ended, self._thawed = asyncio.Event(), asyncio.Event()
        self._thawed.set()
        async with await asyncio.start_server(self._connected, "127.0.0.1", 0) as server:
            self.port = server.sockets[0].getsockname()[1]
            self._started.set()
            await self._ended.wait()

    async def _connected(self, near_reader, near_writer):
        self.accepted += 1
        number = self.accepted
        self._near.append(near_writer)
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self._target_port)
        with contextlib.suppress(asyncio.CancelledError), contextlib.ExitStack() as stack:
            for writer in (near_writer, far_writer):
                stack.callback(writer.transport.abort)
            pumps = (self._pump(number, near_reader, far_writer), self._pump(number, far_reader, near_writer))
            await asyncio.gather(*pumps)
            await self._ended.wait()  # the far end of a stranded connection hears nothing, not even that it ended

    async def _pump(self, number, reader, writer):
        with contextlib.suppress(ConnectionError):
            while data := await reader.read(1024):
                await self._thawed.wait()
                if number > self._stranded:
                    writer.write(data)
                    await writer.drain()
        if number > self._stranded:
            writer.close()
