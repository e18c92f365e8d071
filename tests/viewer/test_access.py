"""The viewer's page answers its own user alone: secret, origin, message size."""

import asyncio
import functools
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("trame")
aiohttp = pytest.importorskip("aiohttp")
msgpack = pytest.importorskip("msgpack")

from ripple_sim.viewer import web  # noqa: E402

SECRET = web.new_secret()
LIMIT = 60.0  # [s]


@asynccontextmanager
async def served(name: str, host: str = "127.0.0.1") -> AsyncIterator[tuple[int, Any, list[str]]]:
    """Port of a page of trame's, a client, and the calls that reached the server."""
    from trame.app import get_server

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        server = get_server(name)
        port = probe.getsockname()[1]
        calls = []
    web.restrict(server, host=host, port=port, secret=SECRET)
    server.controller.trigger_name(lambda: None)
    server.trigger("drive")(lambda: calls.append("drive"))
    serving = asyncio.ensure_future(
        server.start(exec_mode="coroutine", open_browser=False, show_connection_info=False)
    )
    await server.ready
    try:
        async with aiohttp.ClientSession() as client:
            yield port, client, calls
    finally:
        await server.stop()
        await asyncio.wait([serving], timeout=LIMIT)


def in_a_loop(test: Callable[..., Awaitable[None]]) -> Callable[..., None]:
    return functools.wraps(test)(lambda **given: asyncio.run(test(**given)))


def packed(method: str, *args: object, number: str = "rpc:c0:0") -> bytes:
    """A call as the page sends it: a header of identity, offset and size, and the message."""
    message = msgpack.packb(
        {"wslink": "1.0", "id": number, "method": method, "args": list(args), "kwargs": {}}
    )
    return b"\x01\0\0\0\0\0\0\0" + len(message).to_bytes(4, "little") + message


async def answer(ws: Any) -> dict:
    return msgpack.unpackb((await ws.receive_bytes(timeout=LIMIT))[12:])


async def drive(ws: Any, secret: str) -> list[dict]:
    """Say hello with a secret and call the server; return both answers."""
    answers = []
    hello = packed("wslink.hello", {"secret": secret}, number="system:c0:0")
    for message in (hello, packed("trame.trigger", "drive", [], {})):
        await ws.send_bytes(message)
        answers.append(await answer(ws))
    return answers


@in_a_loop
async def test_the_page_itself_drives_the_viewer_with_the_secret() -> None:
    async with served("own") as (port, client, calls):
        for name in (f"127.0.0.1:{port}", f"localhost:{port}"):
            url = f"ws://127.0.0.1:{port}/ws"
            origin = f"http://{name}"
            async with client.ws_connect(url, origin=origin, headers={"Host": name}) as ws:
                hello, _ = await drive(ws, SECRET)
                assert "clientID" in hello["result"]
        assert calls == ["drive", "drive"]


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "http://localhost:1", "null", "https://127.0.0.1.evil.com"]
)
@in_a_loop
async def test_another_site_is_refused_even_with_the_secret(origin: str) -> None:
    async with served(f"origin {origin}") as (port, client, calls):
        with pytest.raises(aiohttp.WSServerHandshakeError) as refusal:
            await client.ws_connect(f"ws://127.0.0.1:{port}/ws", origin=origin)
        assert refusal.value.status == 403
        assert calls == []


@in_a_loop
async def test_a_name_that_another_site_points_at_this_machine_is_refused() -> None:
    async with served("rebinding") as (port, client, _):
        evil = {"Host": f"evil.example:{port}"}
        for path in ("/", "/index.html", "/ws"):
            async with client.get(f"http://127.0.0.1:{port}{path}", headers=evil) as response:
                assert response.status == 403
        with pytest.raises(aiohttp.WSServerHandshakeError, match="403"):
            await client.ws_connect(
                f"ws://127.0.0.1:{port}/ws", origin=f"http://evil.example:{port}", headers=evil
            )


@pytest.mark.parametrize(
    "secret", ["wslink-secret", "", web.new_secret()], ids=["default", "none", "of another run"]
)
@in_a_loop
async def test_without_this_runs_secret_no_call_is_answered(secret: str) -> None:
    async with served(f"secret {secret}") as (port, client, calls):
        async with client.ws_connect(
            f"ws://127.0.0.1:{port}/ws", origin=f"http://127.0.0.1:{port}"
        ) as ws:
            answers = await drive(ws, secret)
        assert ["error" in answer for answer in answers] == [True, True]
        assert calls == []


@in_a_loop
async def test_a_message_longer_than_the_pages_own_ends_the_connection() -> None:
    async with served("size") as (port, client, _):
        async with client.ws_connect(
            f"ws://127.0.0.1:{port}/ws", origin=f"http://127.0.0.1:{port}"
        ) as ws:
            await drive(ws, SECRET)
            await ws.send_bytes(packed("trame.trigger", "x" * 2 * web.LARGEST_MESSAGE))
            closing = await ws.receive(timeout=LIMIT)
        assert closing.type in (aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED)
        assert ws.close_code == aiohttp.WSCloseCode.MESSAGE_TOO_BIG


@in_a_loop
async def test_the_page_cannot_be_framed_by_another_and_gives_its_address_to_none() -> None:
    async with (
        served("framing") as (port, client, _),
        client.get(f"http://127.0.0.1:{port}/index.html") as response,
    ):
        assert response.status == 200
        assert response.headers["Content-Security-Policy"] == "frame-ancestors 'none'"
        assert response.headers["Referrer-Policy"] == "no-referrer"


def test_every_run_has_a_secret_of_its_own_that_is_no_number() -> None:
    secrets = {web.new_secret() for _ in range(100)}
    assert len(secrets) == 100
    assert all(len(secret) == 33 and not secret[0].isdigit() for secret in secrets)


def test_other_machines_are_let_in_by_their_users_choice_alone() -> None:
    assert all(web.is_local(host) for host in ("127.0.0.1", "localhost", "::1"))
    assert not any(web.is_local(host) for host in ("0.0.0.0", "192.168.0.7", "a.b"))
    assert web.address("0.0.0.0", 80, "s1").startswith(f"http://{socket.gethostname()}:80/")
    assert web.address("::1", 80, "s1") == "http://[::1]:80/?secret=s1"


def test_one_line_warns_of_an_exposed_viewer(tmp_path: Path) -> None:
    line = web.exposure("0.0.0.0", tmp_path)
    assert "\n" not in line
    for word in ("--host 0.0.0.0", "sees and drives", str(tmp_path), "nothing is encrypted"):
        assert word in line
