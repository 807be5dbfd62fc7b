"""Attacks the servers of a mission or of a queue without a token, at 1024 open files; prints JSON.

    python -m tests.benchmarks.open_doors run|queue|foxglove [--half-open 1500] [--slow 300] [--sockets 200]

Each client connects again when the server closes its connection. Half-open clients send nothing, slow ones a byte of a
header each second, and the others ask for a websocket. `run` attacks the page of a mission that fetches a drink, with
`--scene` while a viewer with the token has its 3D scene open, `queue` the calls of a server with queued missions,
`foxglove` the live log of a mission. Figures: lost missions, megabytes of standard error, the most open files of the
process, and the slowest answer to a client with the token; with `--scene` also other ports of the process, and how
often the viewer gets new poses.
"""

import asyncio
import json
import re
import resource
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request
from contextlib import nullcontext, suppress
from pathlib import Path

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from tests.benchmarks.errand_process import ROOT, errand, report_of, run_errand
from tests.benchmarks.harness import command

FILES = 1024
SENTENCE = "Hey Alice, can you fetch me a drink from the kitchen"
SLOW_S, AGAIN_S, ANSWER_LIMIT_S = 1.0, 0.5, 10.0
UPGRADE = (
    "GET /feed HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nOrigin: http://127.0.0.1:{port}\r\nUpgrade: websocket\r\n"
    "Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n"
)


class Attack:
    """Clients of a port in a thread of their own; use it as a context manager."""

    def __init__(self, port, *, half_open=1500, slow=300, sockets=200):
        self.connected = 0
        self._port = port
        self._clients = [(half_open, self._wait), (slow, self._send_slowly), (sockets, self._upgrade)]
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_until_complete, args=(self._attack(),), daemon=True)

    def __enter__(self):
        self._over = asyncio.Event()
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._loop.call_soon_threadsafe(self._over.set)
        self._thread.join()
        self._loop.close()

    async def _attack(self):
        tasks = [asyncio.create_task(self._client(act)) for count, act in self._clients for _ in range(count)]
        await self._over.wait()
        for each in tasks:
            each.cancel()
        await asyncio.wait(tasks, timeout=2.0)

    async def _client(self, act):
        while not self._over.is_set():
            with suppress(OSError, TimeoutError):
                reader, writer = await asyncio.wait_for(asyncio.open_connection("127.0.0.1", self._port), 5.0)
                self.connected += 1
                try:
                    await act(reader, writer)
                finally:
                    writer.close()
            await asyncio.sleep(AGAIN_S)

    async def _wait(self, reader, writer):
        await reader.read()

    async def _upgrade(self, reader, writer):
        writer.write(UPGRADE.format(port=self._port).encode())
        while await reader.read(65536):
            pass

    async def _send_slowly(self, reader, writer):
        writer.write(b"GET / HTTP/1.1\r\nx: ")
        ended = asyncio.create_task(reader.read())
        try:
            while not ended.done():
                writer.write(b"y")
                await asyncio.wait([ended], timeout=SLOW_S)
        finally:
            ended.cancel()


class Viewer:
    """A client with the token that shows the scene of a page; use it as a context manager."""

    def __init__(self, url):
        self.scene_mb, self.poses = 0.0, 0
        self._page, _, self._query = url.partition("?")
        self._thread = threading.Thread(target=self._show, daemon=True)

    def __enter__(self):
        with urllib.request.urlopen(f"{self._page}scene?{self._query}", timeout=120.0) as answer:
            self.scene_mb = round(len(answer.read()) / 1e6, 2)
        self._feed = connect(f"{self._page.replace('http', 'ws')}feed?{self._query}", proxy=None, max_size=None)
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._feed.close()
        self._thread.join()

    def _show(self):
        with suppress(ConnectionClosed):
            for text in self._feed:
                self.poses += sum(each.get("live") == "scene" for each in json.loads(text))


class Victim:
    """A process of `errand` with few open files, and what it prints; use it as a context manager."""

    def __init__(self, folder, *words, files=FILES):
        self.folder, self.most_files = folder, 0
        self.out, self.err = folder / "stdout.txt", folder / "stderr.txt"
        with self.out.open("wb") as out, self.err.open("wb") as err:
            limit = lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (files, files))  # noqa: E731
            self.process = subprocess.Popen(errand(*words), cwd=ROOT, stdout=out, stderr=err, preexec_fn=limit)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()

    def printed(self, pattern, limit_s=120.0):
        """First match in what the process prints; raises TimeoutError."""
        end_s = time.monotonic() + limit_s
        while time.monotonic() < end_s:
            if found := re.search(pattern, self.out.read_text() + self.err.read_text(errors="replace")):
                return found
            time.sleep(0.2)
        raise TimeoutError(f"no {pattern} in {self.out.read_text()}{self.err.read_text()[-2000:]}")

    def count_files(self):
        with suppress(OSError):
            self.most_files = max(self.most_files, len(list(Path(f"/proc/{self.process.pid}/fd").iterdir())))


def watch(victim, attacks, ask, limit_s):
    """Waits for the end of a process, or kills it after so long; asks for an answer every second."""
    answers, end_s = [], time.monotonic() + limit_s
    while victim.process.poll() is None and time.monotonic() < end_s:
        victim.count_files()
        begun_s = time.monotonic()
        answers.append(None if not ask() else time.monotonic() - begun_s)
        time.sleep(1.0)
    good = [each for each in answers[:-1] if each is not None]  # the last may have met the end
    return {
        "exit": victim.process.poll(),
        "stderr_mb": round(victim.err.stat().st_size / 1e6, 3),
        "stderr": victim.err.read_text(errors="replace")[:300],
        "most_files": victim.most_files,
        "connected": sum(each.connected for each in attacks),
        "asked": len(answers[:-1]),
        "unanswered": len(answers[:-1]) - len(good),
        "slowest_answer_s": round(max(good, default=ANSWER_LIMIT_S), 2),
    }


def answers(url, **settings):
    """True when a request gets an answer of the server, even a refusal, in time."""
    try:
        with urllib.request.urlopen(urllib.request.Request(url, **settings), timeout=ANSWER_LIMIT_S):
            return True
    except urllib.error.HTTPError:
        return True
    except OSError:
        return False


def run(half_open: int = 1500, slow: int = 300, sockets: int = 200, limit: float = 300.0, scene: bool = False):
    """Attacks the page of a mission; with `--scene` while a viewer has its 3D scene open."""
    counts = {"half_open": half_open, "slow": slow, "sockets": sockets}
    with tempfile.TemporaryDirectory(prefix="errand-doors-") as made:
        words = ["run", "--say", SENTENCE, "--view", "1", "--out", f"{made}/out", "--quiet", "--json"]
        with Victim(Path(made), *words) as victim:
            url = victim.printed(r"http://127.0.0.1:(\d+)/\?token=[\w-]+")
            with Viewer(url[0]) if scene else nullcontext() as viewer, Attack(int(url[1]), **counts) as attack:
                others = other_ports(victim, int(url[1]))
                figures = watch(victim, [attack], lambda: answers(url[0]), limit)
            report = report_of(victim.out.read_text())
    told = {"lost": int(report.get("outcome") != "success"), "outcome": report.get("outcome", "no report")}
    if scene:
        figures |= {"scene_mb": viewer.scene_mb, "poses": viewer.poses, "other_ports": len(others)}
    return {**told, "message": report.get("message", ""), **figures}


def other_ports(victim, page):
    """Other ports at which the process listens."""
    listed = subprocess.run(["ss", "-Hltnp"], capture_output=True, text=True, check=True).stdout
    own = [line.split()[3] for line in listed.splitlines() if f"pid={victim.process.pid}," in line]
    return [port for port in (int(each.rpartition(":")[2]) for each in own) if port != page]


def queue(missions: int = 20, half_open: int = 1500, slow: int = 300, sockets: int = 200, limit: float = 400.0):
    """Attacks the calls of a server with queued missions."""
    with tempfile.TemporaryDirectory(prefix="errand-doors-") as made:
        out = ["--out", f"{made}/out", "--store", f"{made}/out/.errand/missions.sqlite"]
        run_errand("queue", "add", "--say", "Hey Alice, go to the kitchen", "--on", "call patrol", *out)
        for _ in range(missions):
            asked = run_errand("queue", "add", "--say", "Hey Alice, go to the kitchen", "--seed", "1", *out)
            assert asked.returncode == 0, asked.stderr
        words = ["queue", "serve", "--port", "0", *out, "--until-idle", "--quiet", "--json", "--token", "a-token-here"]
        with Victim(Path(made), *words) as victim:
            url = victim.printed(r"http://127.0.0.1:(\d+)/missions/")
            with Attack(int(url[1]), half_open=half_open, slow=slow, sockets=sockets) as attack:
                headers = {"Authorization": "Bearer a-token-here"}
                ask = lambda: answers(f"{url[0]}other", method="POST", data=b"", headers=headers)  # noqa: E731
                figures = watch(victim, [attack], ask, limit)
            listed = json.loads(run_errand("queue", "list", *out, "--json").stdout.splitlines()[-1])["missions"]
    states = [each["state"] for each in listed if each["state"] != "standing"]
    lost = sum(state not in ("success", "queued") for state in states)
    return {"lost": lost, "done": states.count("success"), "first_message": listed[1]["message"], **figures}


def foxglove(half_open: int = 1500, slow: int = 300, sockets: int = 200, limit: float = 300.0):
    """Attacks Foxglove's server of a mission."""
    with tempfile.TemporaryDirectory(prefix="errand-doors-") as made:
        words = ["run", "--say", SENTENCE, "--foxglove", "127.0.0.1:0", "--out", f"{made}/out", "--quiet", "--json"]
        with Victim(Path(made), *words) as victim:
            url = victim.printed(r"ws://127.0.0.1:(\d+)")
            with Attack(int(url[1]), half_open=half_open, slow=slow, sockets=sockets) as attack:
                figures = watch(victim, [attack], lambda: answers(f"http://127.0.0.1:{url[1]}/"), limit)
            report = report_of(victim.out.read_text())
    return {"lost": int(report.get("outcome") != "success"), "message": report.get("message", ""), **figures}


if __name__ == "__main__":
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    sys.setrecursionlimit(10_000)
    command(run, queue, foxglove)
