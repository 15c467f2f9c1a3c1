"""`tracemesh serve --lan`: TLS that a client verifies, an authority that can do little, plain HTTP that leads on."""

import re
import ssl
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

import httpx
import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding
from websockets.sync.client import connect

from tests.api.conftest import free_port
from tracemesh.api.lan import authority
from tracemesh.api.lan.addresses import addresses, host_names, main_address
from tracemesh.api.lan.authority import Authority
from tracemesh.doctor import check_port
from tracemesh.settings import Settings


@dataclass(frozen=True)
class LanServer:
    """What a person reads at the start, and the file to trust."""

    said: str
    ca: Path

    @property
    def trust(self) -> ssl.SSLContext:
        return ssl.create_default_context(cafile=self.ca)

    @property
    def secret(self) -> str:
        return re.findall(r"\?token=(\S+)", self.said)[0]

    def port(self, scheme: str) -> str:
        return re.findall(rf"{scheme}://[^ ]*?:(\d+)/", self.said)[0]

    def address(self, scheme: str, host: str = "127.0.0.1") -> str:
        return f"{scheme}://{host}:{self.port(scheme)}"


@pytest.fixture(scope="module")
def lan(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LanServer]:
    """A server process as a person starts it."""
    folder = tmp_path_factory.mktemp("lan")
    command = [sys.executable, "-m", "tracemesh", "serve", "--lan", "--port", str(free_port()), "--data-dir", folder]
    with (folder / "said").open("w") as said, subprocess.Popen(command, stdout=said, stderr=said) as process:
        while "Phones first open" not in (folder / "said").read_text():
            assert process.poll() is None, (folder / "said").read_text()
            time.sleep(0.05)
        yield LanServer((folder / "said").read_text(), folder / "tls" / "ca.crt")
        process.terminate()


@pytest.mark.parametrize("host", [main_address(), "127.0.0.1", "localhost"])
def test_whoever_trusts_the_authority_is_sure_of_the_server(lan: LanServer, host: str) -> None:
    url = lan.address("https", host)
    headers = {"Authorization": f"Bearer {lan.secret}"}
    assert httpx.get(f"{url}/api/v1/sessions", headers=headers, verify=lan.trust).json() == []
    assert httpx.get(f"{url}/api/v1/sessions", verify=lan.trust).status_code == 401
    with pytest.raises(httpx.ConnectError, match=r"self-signed certificate|unable to get local issuer"):
        httpx.get(f"{url}/healthz")


def test_the_cookie_stays_on_tls(lan: LanServer) -> None:
    answer = httpx.get(lan.address("https"), params={"token": lan.secret}, verify=lan.trust)
    assert "Secure" in answer.headers["set-cookie"]


def test_sockets_are_secure_too(lan: LanServer) -> None:
    headers = {"Authorization": f"Bearer {lan.secret}"}
    url = lan.address("https").replace("https", "wss")
    with connect(f"{url}/api/v1/ingest", ssl=lan.trust, additional_headers=headers) as device:
        device.send("[]")
        assert "malformed" in str(device.recv(timeout=60))


def test_plain_http_leads_to_https_and_drops_what_was_secret(lan: LanServer) -> None:
    answer = httpx.get(f"{lan.address('http')}/scan.html?token=secret")
    assert (answer.status_code, answer.headers["location"]) == (308, f"{lan.address('https')}/scan.html")
    answer = httpx.post(f"{lan.address('http')}//evil.example/x", headers={"Host": "evil.example"})
    assert answer.headers["location"] == f"{lan.address('https', main_address())}/evil.example/x"


def test_plain_http_gives_the_certificate_away_with_help(lan: LanServer) -> None:
    page = httpx.get(lan.address("http")).text
    made = x509.load_pem_x509_certificate(lan.ca.read_bytes())
    got = httpx.get(lan.address("http") + re.findall(r'href="(/[^"]+\.crt)"', page)[0])
    assert got.headers["content-type"] == "application/x-x509-ca-cert"
    assert got.content == made.public_bytes(Encoding.DER)
    fingerprint = re.findall(r"SHA-256  (\S+)", lan.said)[0]
    assert fingerprint in page
    assert all(system in page for system in ("iPhone", "Android", "Windows", "macOS", "Linux"))


def test_the_doctor_knows_the_server(lan: LanServer, tmp_path: Path) -> None:
    port = int(lan.port("https"))
    told = check_port(Settings(data_dir=tmp_path, port=port))
    assert (told.what, told.advice) == (f"a server answers at 127.0.0.1:{port}", "")


def test_a_certificate_lasts_from_start_to_start_and_keys_are_nobody_elses(tmp_path: Path) -> None:
    names = [*addresses(), *host_names()]
    first = [file.read_bytes() for file in Authority(tmp_path / "tls", names).certify(names)]
    again = Authority(tmp_path / "tls", names)
    assert [file.read_bytes() for file in again.certify(names)] == first
    for file in (tmp_path / "tls").iterdir():
        assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert stat.S_IMODE((tmp_path / "tls").stat().st_mode) == 0o700


def test_a_certificate_is_renewed_for_new_addresses_and_in_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Authority(tmp_path, ["10.0.0.1", "localhost"])
    before = made.certify(["10.0.0.1", "localhost"])[0].read_bytes()
    moved = made.certify(["10.0.0.2", "localhost"])[0].read_bytes()
    assert moved != before
    monkeypatch.setattr(authority, "RENEW_BEFORE", timedelta(days=396))
    assert made.certify(["10.0.0.2", "localhost"])[0].read_bytes() != moved
    assert Authority(tmp_path, ["10.0.0.2"]).fingerprint == made.fingerprint


def test_an_authority_that_cannot_speak_for_this_machine_any_more_is_made_anew(tmp_path: Path) -> None:
    first = Authority(tmp_path, ["203.0.113.1"])
    assert Authority(tmp_path, ["203.0.113.1", "192.168.7.7"]).fingerprint == first.fingerprint
    assert Authority(tmp_path, ["203.0.113.2"]).fingerprint != first.fingerprint
    (tmp_path / "ca.key").write_text("spoilt")
    second = Authority(tmp_path, ["203.0.113.2"])
    assert handshake(second, tmp_path / "ca.crt", "203.0.113.2") == ""


@pytest.mark.parametrize(
    ("name", "trusted"), [("localhost", True), ("10.1.2.3", True), ("bank.example", False), ("198.51.100.1", False)]
)
def test_who_trusts_the_authority_trusts_it_for_nothing_else(
    tmp_path: Path, name: str, trusted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Even one who stole its key could not pass for a site of the internet."""
    made = Authority(tmp_path, ["localhost"])
    monkeypatch.setattr(Authority, "covers", lambda self, name: True)
    assert ("permitted subtree violation" in handshake(made, made.file, name)) != trusted


def handshake(made: Authority, ca: Path, name: str) -> str:
    """Why a client that trusts the authority refuses a server of this name; empty when it does not."""
    served = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    served.load_cert_chain(*made.certify([name]))
    to_server, to_client = ssl.MemoryBIO(), ssl.MemoryBIO()
    client = ssl.create_default_context(cafile=ca).wrap_bio(to_client, to_server, server_hostname=name)
    server = served.wrap_bio(to_server, to_client, server_side=True)
    for _ in range(5):
        for side in (client, server):
            try:
                side.do_handshake()
            except ssl.SSLWantReadError:
                continue
            except ssl.SSLCertVerificationError as error:
                return error.verify_message
    assert client.version() == "TLSv1.3"
    return ""


def test_keys_are_of_the_curve_that_every_phone_knows(tmp_path: Path) -> None:
    key = Authority(tmp_path, ["localhost"]).certificate.public_key()
    assert isinstance(key, ec.EllipticCurvePublicKey)
    assert key.curve.name == "secp256r1"
