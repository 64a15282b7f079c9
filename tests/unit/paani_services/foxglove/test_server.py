"""The server itself: addresses and certificates that it cannot have, and encryption where it can."""

from __future__ import annotations

import asyncio
import datetime
import ipaddress
import json
import socket
import ssl
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from paani import keys
from paani.config import FoxgloveConfig
from paani.errors import UserError
from paani_services.foxglove.channels import channels
from paani_services.foxglove.service import read_pem
from tests.conftest import find_free_port

server = pytest.importorskip(
    "paani_services.foxglove.server", reason="the extra foxglove is not installed", exc_type=ModuleNotFoundError
)
OFFERED = channels(keys.Graph.SIMULATION)


@contextmanager
def serving(pem: bytes | None = None, **settings: Any) -> Iterator[Any]:
    running = server.ViewerServer(FoxgloveConfig(**settings), "PAANI otter", OFFERED, {"bus.vessel": "otter"}, pem)
    try:
        yield running
    finally:
        running.stop()


def test_an_address_in_use_is_named() -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as taken:
        port = taken.getsockname()[1]
        with (
            pytest.raises(UserError, match=rf"^foxglove.host, foxglove.port 127.0.0.1:{port}: .*in use"),
            serving(port=port),
        ):
            pass


def test_a_file_that_is_no_certificate_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"^foxglove.tls_pem a.pem: "), serving(b"rubbish", tls_pem="a.pem"):
        pass
    missing = tmp_path / "none.pem"
    with pytest.raises(UserError, match=r"foxglove.tls_pem .*none.pem: No such file"):
        read_pem(FoxgloveConfig(tls_pem=str(missing)))
    assert read_pem(FoxgloveConfig()) is None


@pytest.mark.slow
async def test_with_a_certificate_nothing_goes_out_in_clear(tmp_path: Path) -> None:
    """A client that trusts the certificate is served; one that does not, or speaks in clear, is not."""
    file = tmp_path / "boat.pem"
    certificate = write_pem(file)
    port = find_free_port()
    config = FoxgloveConfig(port=port, tls_pem=str(file))
    with serving(await asyncio.to_thread(read_pem, config), port=port, tls_pem=str(file)):
        trusting = ssl.create_default_context(cadata=certificate)
        words: dict[str, Any] = {"protocols": ["foxglove.sdk.v1"], "timeout": aiohttp.ClientWSTimeout(ws_close=0.1)}
        async with aiohttp.ClientSession() as http:
            async with http.ws_connect(f"wss://127.0.0.1:{port}/", ssl=trusting, **words) as viewer:
                assert json.loads((await viewer.receive()).data)["name"] == "PAANI otter"
            with pytest.raises(aiohttp.ClientConnectorCertificateError):
                await http.ws_connect(f"wss://127.0.0.1:{port}/", **words)
            with pytest.raises(aiohttp.ClientError):
                await http.ws_connect(f"ws://127.0.0.1:{port}/", **words)


def write_pem(file: Path) -> str:
    """A certificate of this address with its key, in one file; returns the certificate."""
    x509 = pytest.importorskip("cryptography.x509", reason="the extra certs is not installed")
    from cryptography.hazmat.primitives import hashes, serialization  # noqa: PLC0415  # of an extra
    from cryptography.hazmat.primitives.asymmetric import ec  # noqa: PLC0415  # of an extra

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "boat")])
    start = datetime.datetime(2020, 1, 1, tzinfo=datetime.UTC)
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(1)
        .not_valid_before(start)
        .not_valid_after(start + datetime.timedelta(days=36_500))
        .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]), critical=False)
        .sign(key, hashes.SHA256())
        .public_bytes(serialization.Encoding.PEM)
    )
    private = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    file.write_bytes(made + private)
    return str(made.decode())
