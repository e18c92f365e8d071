"""The viewer's page answers its own user alone: secret, origin, message size."""

import contextlib
import http.client
import json
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from ripple_sim.errors import DisplayError
from ripple_sim.scene import Scene
from ripple_sim.viewer import PageServer, PageView, Session, access, served, view_of

LIMIT = 60.0  # [s]


@pytest.fixture(scope="module")
def view(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> PageView:
    session = Session(scene, resolution=8, has_skins=False)
    return view_of(session, tmp_path_factory.mktemp("folder"), 8)


@pytest.fixture(scope="module")
def server(view: PageView) -> Iterator[PageServer]:
    with served(view.pages, 0, "127.0.0.1") as server:
        yield server


def asked(server: PageServer, path: str, **headers: str) -> http.client.HTTPResponse:
    """The answer to a request, read to its end."""
    connection = http.client.HTTPConnection(urlsplit(server.address).netloc, timeout=LIMIT)
    connection.request("GET", path, headers=headers)
    return connection.getresponse()


def page_of(server: PageServer) -> str:
    """Open a page; return the query of its socket."""
    where = urlsplit(server.address)
    response = asked(server, f"/?{where.query}")
    assert response.status == 200
    text = response.read().decode()
    (meta,) = (line for line in text.splitlines() if 'id="meta"' in line)
    number = json.loads(meta.split(">", 1)[1].rsplit("<", 1)[0])["stream"]["number"]
    return f"{where.query}&page={number}"


def socket_of(server: PageServer, query: str, **options: object) -> ClientConnection:
    where = urlsplit(server.address)
    options.setdefault("origin", f"http://{where.netloc}")
    return connect(f"ws://{where.netloc}/socket?{query}", open_timeout=LIMIT, **options)


def answer_to(page: ClientConnection, view: PageView) -> str:
    """What the view says next to a page; it runs meanwhile."""
    end = time.monotonic() + LIMIT
    while time.monotonic() < end:
        view.tick()
        with contextlib.suppress(TimeoutError):  # the message may still be on its way
            answer = page.recv(0.05)
            said = "" if isinstance(answer, bytes) else json.loads(answer).get("say", "")
            if said:
                return said
    raise AssertionError("no answer")


def test_the_page_itself_drives_the_viewer_with_the_secret(
    server: PageServer, view: PageView
) -> None:
    with socket_of(server, page_of(server)) as page:
        page.send(json.dumps({"do": "pause"}))
        while not view.session.paused:
            view.tick()
        assert isinstance(page.recv(LIMIT), bytes | str)
        view.session.paused = False


def test_a_wrong_command_is_answered_in_one_line(server: PageServer, view: PageView) -> None:
    with socket_of(server, page_of(server)) as page:
        for message, reason in [
            ('{"do": "fly"}', "command must be one of poke"),
            ('{"do": "poke", "target": 7}', "target must be a number from 0 to 0, got 7"),
            ('{"do": "poke", "point": [1]}', r"point"),
            ('{"do": "drag", "body": -3}', "body must be a number from 1"),
            ("no JSON", "JSON"),
            ('{"do": "factors", "factors": {"speed": 1e9}}', "a factor must be from 0 to 8"),
        ]:
            page.send(message)
            said = answer_to(page, view)
            assert reason in said
            assert "\n" not in said


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "http://localhost:1", "null", "https://127.0.0.1.evil.com"]
)
def test_another_site_is_refused_even_with_the_secret(server: PageServer, origin: str) -> None:
    query = page_of(server)
    with pytest.raises(InvalidStatus, match="403"):
        socket_of(server, query, origin=origin)


def test_a_name_that_another_site_points_at_this_machine_is_refused(server: PageServer) -> None:
    port = urlsplit(server.address).port
    query = urlsplit(server.address).query
    for path in ("/", "/index.html", "/socket"):
        assert asked(server, f"{path}?{query}", Host=f"evil.example:{port}").status == 403


@pytest.mark.parametrize("secret", ["", "secret=", "secret=" + 32 * "0"])
def test_without_this_runs_secret_nothing_is_answered(server: PageServer, secret: str) -> None:
    assert asked(server, f"/?{secret}").status == 403
    with pytest.raises(InvalidStatus, match="403"):
        socket_of(server, f"{secret}&page=1")


def test_a_page_has_one_socket(server: PageServer) -> None:
    query = page_of(server)
    with (
        socket_of(server, query),
        socket_of(server, query) as second,
        pytest.raises(ConnectionClosed, match="open the page anew"),
    ):
        second.recv(LIMIT)


def test_a_message_longer_than_the_pages_own_ends_the_connection(server: PageServer) -> None:
    with socket_of(server, page_of(server)) as page:
        page.send("x" * 2 * access.LARGEST_MESSAGE)
        with pytest.raises(ConnectionClosed) as closing:
            while True:
                page.recv(LIMIT)
        assert closing.value.rcvd.code == 1009  # too big


def test_the_page_cannot_be_framed_by_another_and_gives_its_address_to_none(
    server: PageServer,
) -> None:
    response = asked(server, f"/?{urlsplit(server.address).query}")
    assert response.headers["Content-Security-Policy"] == "frame-ancestors 'none'"
    assert response.headers["Referrer-Policy"] == "no-referrer"
    response.read()


def test_the_page_is_served_on_the_loopback_address_alone(server: PageServer) -> None:
    port = urlsplit(server.address).port
    connections = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()]
    addresses = {fields[1] for fields in connections if fields[3] == "0A"}  # those that listen
    assert f"0100007F:{port:04X}" in addresses
    assert f"00000000:{port:04X}" not in addresses


def test_every_run_has_a_secret_of_its_own() -> None:
    secrets = {access.new_secret() for _ in range(100)}
    assert len(secrets) == 100
    assert all(len(secret) == 32 for secret in secrets)


def test_only_the_user_can_let_other_machines_in() -> None:
    assert all(access.is_local(host) for host in ("127.0.0.1", "localhost", "::1"))
    assert not any(access.is_local(host) for host in ("0.0.0.0", "192.168.0.7", "a.b"))
    assert access.address("0.0.0.0", 80, "s1").startswith(f"http://{socket.gethostname()}:80/")
    assert access.address("::1", 80, "s1") == "http://[::1]:80/?secret=s1"


def test_one_line_warns_of_an_exposed_viewer(tmp_path: Path) -> None:
    line = access.exposure("0.0.0.0", tmp_path)
    assert "\n" not in line
    for word in ("--host 0.0.0.0", "sees and drives", str(tmp_path), "nothing is encrypted"):
        assert word in line


@pytest.mark.parametrize("port", [-1, 65536, 1234567])
def test_a_number_that_is_no_port_is_refused(port: int) -> None:
    with pytest.raises(DisplayError, match="port must be a whole number from 0 to 65535"):
        access.check_port(port, "127.0.0.1")
