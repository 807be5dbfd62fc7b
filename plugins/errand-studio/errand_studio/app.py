"""Server of the studio, with its pages and addresses."""

from __future__ import annotations

import asyncio
import logging
import secrets
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final

import uvicorn
from fastapi import FastAPI, Request
from nicegui import app as nicegui_app
from nicegui import core, ui

from errand_studio.board_page import board_page, compare_page, picture
from errand_studio.completion import complete
from errand_studio.guard import Guard
from errand_studio.workshop import Workshop
from errand_studio.write_page import WritePage
from executive.view.serving import open_port, url_of
from skills.inputs.errors import InputError

HOST: Final = "127.0.0.1"
MOST_MESSAGE: Final = 3_000_000


def register(workshop: Workshop) -> None:
    """Registers the pages and addresses of a studio."""

    @ui.page("/", title="errand studio")
    async def _write(file: str = "") -> None:
        await WritePage(workshop).build(file)

    @ui.page("/board", title="errand studio: board")
    async def _board(mission: str = "") -> None:
        await board_page(workshop.table, mission)

    @ui.page("/compare", title="errand studio: two runs")
    async def _compare(a: str = "", b: str = "") -> None:
        await compare_page(workshop.table, a, b)

    @nicegui_app.get("/picture")
    async def _picture(run: str, name: str) -> Any:
        return await asyncio.to_thread(picture, workshop.table, run, name)

    @nicegui_app.post("/complete")
    async def _complete(request: Request) -> dict[str, Any]:
        asked = await request.json()
        knowledge = await asyncio.to_thread(workshop.knowledge_for, str(asked["text"]))
        start, options = complete(str(asked["text"]), int(asked["line"]), int(asked["column"]), knowledge)
        return {"from": start, "options": options}


def serve(workshop: Workshop, port: int, tell: Callable[[str], None]) -> None:
    """Serves the studio on 127.0.0.1 until Ctrl-C; `tell` gets the address. Raises InputError if the port is taken."""
    try:
        opened = open_port(HOST, port)
    except OSError as error:
        what = f"cannot serve the page at port {port} ({error.strerror})"
        raise InputError(what, hint="name another --view-port") from error
    workshop.runs.origins = " ".join(f"http://{host}:{opened.getsockname()[1]}" for host in (HOST, "localhost"))
    token = secrets.token_urlsafe(24)
    register(workshop)
    site = FastAPI(openapi_url=None, lifespan=None)
    ui.run_with(site, title="errand studio", dark=None, show_welcome_message=False, tailwind=False)
    logging.getLogger("nicegui").setLevel(logging.ERROR)
    core.sio.eio.max_http_buffer_size = MOST_MESSAGE
    nicegui_app.on_startup(lambda: tell(f"The studio: {url_of(*opened.getsockname()[:2])}?token={token}"))
    nicegui_app.on_shutdown(workshop.runs.close)
    config = uvicorn.Config(
        Guard(site, token),
        log_level="critical",
        access_log=False,
        ws_max_size=MOST_MESSAGE,
        ws="websockets-sansio",
    )
    with suppress(KeyboardInterrupt):
        uvicorn.Server(config).run(sockets=[opened])
