"""The page over HTTPS on the network's own address, as a browser that trusts its certificate sees it."""

import base64
import re
import subprocess
import sys
import time
from hashlib import sha256
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat
from playwright.sync_api import expect, sync_playwright

from tests.web.conftest import CHROMIUM, FLAGS
from tests.web.support import PATIENCE, free_port


def test_the_owners_link_opens_a_secure_page_and_leaves_the_address(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tracemesh", "serve", "--lan", "--port", str(free_port()), "--data-dir", tmp_path]
    said = tmp_path / "said"
    with said.open("w") as log, subprocess.Popen(command, stdout=log, stderr=log) as process:
        try:
            while "Phones first open" not in said.read_text():
                assert process.poll() is None, said.read_text()
                time.sleep(0.05)
            look(said.read_text(), tmp_path / "tls" / "server.crt")
        finally:
            process.terminate()


def look(said: str, certificate: Path) -> None:
    (link,) = re.findall(r"Open  (\S+)", said)
    key = x509.load_pem_x509_certificate(certificate.read_bytes()).public_key()
    spki = sha256(key.public_bytes(Encoding.DER, PublicFormat.SubjectPublicKeyInfo)).digest()
    trust = f"--ignore-certificate-errors-spki-list={base64.b64encode(spki).decode()}"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=[*FLAGS, trust])
        page = browser.new_page()
        page.set_default_timeout(1000 * PATIENCE)
        page.goto(link)
        expect(page.get_by_role("button", name="New session")).to_be_visible(timeout=1000 * PATIENCE)
        assert page.evaluate("isSecureContext") is True
        assert page.url == link.partition("?")[0]
        browser.close()
