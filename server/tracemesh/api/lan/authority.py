"""The project's own certificate authority: made once, for names of this machine and of private networks only."""

import contextlib
import ipaddress
import os
import socket
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

PRIVATE = (
    "10.0.0.0/8",
    "172.16.0.0/12",
    "192.168.0.0/16",
    "169.254.0.0/16",
    "100.64.0.0/10",
    "127.0.0.0/8",
    "fc00::/7",
    "::1/128",
)
"""Networks for whose addresses the authority may speak: whoever trusts it trusts it for nothing on the internet."""
AUTHORITY_LIFE = timedelta(days=3650)
SERVER_LIFE = timedelta(days=397)
"""The longest that Apple's systems take."""
RENEW_BEFORE = timedelta(days=60)
Name = x509.DNSName | x509.IPAddress


class Authority:
    """Keeps its files in one folder; private keys are readable by their owner only."""

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        """Load the authority, or make one; anew when it may not speak for these names of this machine."""
        self._folder = folder
        self.file = folder / "ca.crt"
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        if not self._load(names):
            self._make(names)
            self.certificate = x509.load_pem_x509_certificate(self.file.read_bytes())

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the certificate, as systems show it."""
        return self.certificate.fingerprint(hashes.SHA256()).hex(":").upper()

    def certify(self, names: Sequence[str]) -> tuple[Path, Path]:
        """Files of a certificate and its key for these names; made anew only when names or time want it.

        Names for which the authority may not speak are left out.
        """
        names = [name for name in names if self.covers(name)]
        certificate, key = self._folder / "server.crt", self._folder / "server.key"
        if not self._is_good(certificate, names):
            fresh = ec.generate_private_key(ec.SECP256R1())
            signed = self._server_certificate(fresh.public_key(), names)
            _write_secretly(key, _pem(fresh))
            _write_secretly(certificate, signed.public_bytes(serialization.Encoding.PEM))
        return certificate, key

    def covers(self, name: str) -> bool:
        """Whether it may speak for a machine of this name or address."""
        constraints = self.certificate.extensions.get_extension_for_class(x509.NameConstraints).value
        return any(_is_within(_name(name), tree) for tree in constraints.permitted_subtrees or [])

    def _load(self, names: Sequence[str]) -> bool:
        with contextlib.suppress(OSError, ValueError, x509.ExtensionNotFound):
            self.certificate = x509.load_pem_x509_certificate(self.file.read_bytes())
            _load_key(self._folder / "ca.key")
            lasts = self.certificate.not_valid_after_utc > datetime.now(UTC) + SERVER_LIFE
            return lasts and all(map(self.covers, names))
        return False

    def _make(self, names: Sequence[str]) -> None:
        key = ec.generate_private_key(ec.SECP256R1())
        title = x509.Name(
            [x509.NameAttribute(NameOID.COMMON_NAME, f"tracemesh {socket.gethostname()[:40]} {os.urandom(3).hex()}")]
        )
        usage = _key_usage(key_cert_sign=True, crl_sign=True)
        signed = (
            _builder(title, title, key.public_key(), AUTHORITY_LIFE)
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(usage, critical=True)
            .add_extension(x509.NameConstraints(_subtrees(names), None), critical=True)
            .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
            .sign(key, hashes.SHA256())
        )
        _write_secretly(self._folder / "ca.key", _pem(key))
        _write_secretly(self.file, signed.public_bytes(serialization.Encoding.PEM))

    def _server_certificate(self, key: ec.EllipticCurvePublicKey, names: Sequence[str]) -> x509.Certificate:
        own_key = _load_key(self._folder / "ca.key")
        title = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "tracemesh server")])
        issuer = x509.AuthorityKeyIdentifier.from_issuer_public_key(own_key.public_key())
        return (
            _builder(title, self.certificate.subject, key, SERVER_LIFE)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(_key_usage(digital_signature=True), critical=True)
            .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
            .add_extension(x509.SubjectAlternativeName(list(map(_name, names))), critical=False)
            .add_extension(x509.SubjectKeyIdentifier.from_public_key(key), critical=False)
            .add_extension(issuer, critical=False)
            .sign(own_key, hashes.SHA256())
        )

    def _is_good(self, file: Path, names: Sequence[str]) -> bool:
        with contextlib.suppress(OSError, ValueError, x509.ExtensionNotFound):
            found = x509.load_pem_x509_certificate(file.read_bytes())
            named = found.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
            ours = found.issuer == self.certificate.subject
            return ours and set(named) == set(map(_name, names)) and _lasts(found)
        return False


def _lasts(certificate: x509.Certificate) -> bool:
    return certificate.not_valid_before_utc <= datetime.now(UTC) < certificate.not_valid_after_utc - RENEW_BEFORE


def _name(text: str) -> Name:
    try:
        return x509.IPAddress(ipaddress.ip_address(text))
    except ValueError:
        return x509.DNSName(text)


def _subtrees(names: Sequence[str]) -> list[Name]:
    """Private networks, and what this machine is called besides."""
    trees: list[Name] = [x509.DNSName("local"), *(x509.IPAddress(ipaddress.ip_network(n)) for n in PRIVATE)]
    for name in map(_name, names):
        if not any(_is_within(name, tree) for tree in trees):
            own = ipaddress.ip_network(name.value) if isinstance(name, x509.IPAddress) else None
            trees.append(name if own is None else x509.IPAddress(own))
    return trees


def _is_within(name: Name, tree: x509.GeneralName) -> bool:
    if isinstance(name, x509.IPAddress):
        address, network = ipaddress.ip_address(str(name.value)), getattr(tree, "value", None)
        return isinstance(network, ipaddress.IPv4Network | ipaddress.IPv6Network) and address in network
    return isinstance(tree, x509.DNSName) and (name.value == tree.value or name.value.endswith(f".{tree.value}"))


def _builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePublicKey, life: timedelta
) -> x509.CertificateBuilder:
    """Valid from a day ago: clocks of phones differ."""
    begin = datetime.now(UTC) - timedelta(days=1)
    builder = x509.CertificateBuilder().subject_name(subject).issuer_name(issuer).public_key(key)
    return builder.serial_number(x509.random_serial_number()).not_valid_before(begin).not_valid_after(begin + life)


def _key_usage(**used: bool) -> x509.KeyUsage:
    kinds = ("digital_signature", "content_commitment", "key_encipherment", "data_encipherment", "key_agreement")
    rest = ("key_cert_sign", "crl_sign", "encipher_only", "decipher_only")
    return x509.KeyUsage(**{kind: used.get(kind, False) for kind in kinds + rest})


def _load_key(file: Path) -> ec.EllipticCurvePrivateKey:
    key = serialization.load_pem_private_key(file.read_bytes(), None)
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise ValueError(f"{file}: wanted a key of an elliptic curve")
    return key


def _pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    form = serialization.PrivateFormat.PKCS8
    return key.private_bytes(serialization.Encoding.PEM, form, serialization.NoEncryption())


def _write_secretly(file: Path, content: bytes) -> None:
    """The whole file or the old one, never readable by others."""
    new = file.with_suffix(file.suffix + ".new")
    new.unlink(missing_ok=True)
    with os.fdopen(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as target:
        target.write(content)
        target.flush()
        os.fsync(target.fileno())
    new.replace(file)
