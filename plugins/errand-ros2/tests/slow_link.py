"""A proxy of TCP before a router, which delays bytes at random and can stand still."""

import socket
import threading
import time
from contextlib import contextmanager, suppress

import numpy as np


class SlowLink:
    """Forwards connections to a port; `stall` holds all bytes of both directions meanwhile."""

    def __init__(self, port, *, seed=1, most_s=0.15):
        self._to, self._most_s, self._chance = port, most_s, np.random.default_rng(seed)
        self._flows, self._sockets = threading.Event(), []
        self._flows.set()
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self):
        with suppress(OSError):
            while True:
                near, _ = self._server.accept()
                far = socket.create_connection(("127.0.0.1", self._to))
                for each in (near, far):
                    each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._sockets += [near, far]
                for ends in ((near, far), (far, near)):
                    threading.Thread(target=self._forward, args=ends, daemon=True).start()

    def _forward(self, source, sink):
        with suppress(OSError):
            while data := source.recv(1 << 16):
                time.sleep(self._chance.uniform(0.0, self._most_s))
                self._flows.wait()
                sink.sendall(data)
        for each in (source, sink):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)

    @contextmanager
    def stall(self):
        """Holds all bytes while the block lasts."""
        self._flows.clear()
        try:
            yield
        finally:
            self._flows.set()

    def close(self):
        """Ends all connections."""
        self._flows.set()
        for each in (self._server, *self._sockets):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()
