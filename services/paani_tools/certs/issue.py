"""Signing: the authority's own certificate, and those of what listens and of who connects."""

from __future__ import annotations

import datetime
import ipaddress
from typing import NamedTuple

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from paani.certificates import Certificate
from paani.errors import UserError

BACKDATED = datetime.timedelta(days=1)  # a board without a clock of its own is behind for a while
LOCAL = ("127.0.0.1", "::1", "localhost")  # where each router's own machine reaches it


class Issued(NamedTuple):
    """A new certificate and its private key, both in PEM, and what `identities.json` says of it."""

    certificate: Certificate
    pem: bytes
    key_pem: bytes


class Signer(NamedTuple):
    """The authority with its private key."""

    certificate: x509.Certificate
    key: ec.EllipticCurvePrivateKey


def make_authority(common_name: str, number: int, now_us: int, days: int) -> Issued:
    """A certificate that signs others, and signs itself."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = _name(common_name)
    builder = (
        _builder(name, name, key, now_us, days)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_key_usage(signs_certificates=True), critical=True)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(key.public_key()), critical=False)
    )
    return _issued(builder.sign(key, hashes.SHA256()), key, number)


def make_listener(signer: Signer, name: str, number: int, now_us: int, days: int, addresses: tuple[str, ...]) -> Issued:
    """A certificate by which a router is known at these addresses, and at its own machine's loopback."""
    places = dict.fromkeys((*LOCAL, *addresses))
    names = x509.SubjectAlternativeName([general_name(place) for place in places])
    return _make_leaf(signer, name, number, (now_us, days), ExtendedKeyUsageOID.SERVER_AUTH, names)


def make_client(signer: Signer, name: str, number: int, now_us: int, days: int) -> Issued:
    """A certificate for one who connects; it cannot pass for a router."""
    return _make_leaf(signer, name, number, (now_us, days), ExtendedKeyUsageOID.CLIENT_AUTH, None)


def read_signer(pem: bytes, key_pem: bytes) -> Signer:
    """Raises ValueError where the files hold no such key or certificate."""
    key = serialization.load_pem_private_key(key_pem, password=None)
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise ValueError("not a key of an elliptic curve")
    return Signer(x509.load_pem_x509_certificate(pem), key)


def general_name(place: str) -> x509.GeneralName:
    """An IP address or a host's name. Raises UserError."""
    try:
        return x509.IPAddress(ipaddress.ip_address(place))
    except ValueError:
        pass
    if not place or not all(label.replace("-", "").isalnum() and label.isascii() for label in place.split(".")):
        raise UserError(f"--address {place!r}: expected an IP address or a host's name")
    return x509.DNSName(place)


def _make_leaf(
    signer: Signer,
    name: str,
    number: int,
    validity: tuple[int, int],
    usage: x509.ObjectIdentifier,
    names: x509.SubjectAlternativeName | None,
) -> Issued:
    key = ec.generate_private_key(ec.SECP256R1())
    end = signer.certificate.not_valid_after_utc
    builder = (
        _builder(_name(f"{name}.{number}"), signer.certificate.subject, key, *validity, end)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_key_usage(signs_certificates=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage([usage]), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(signer.key.public_key()), critical=False)
    )
    if names is not None:
        builder = builder.add_extension(names, critical=False)
    return _issued(builder.sign(signer.key, hashes.SHA256()), key, number)


def _builder(
    subject: x509.Name,
    issuer: x509.Name,
    key: ec.EllipticCurvePrivateKey,
    now_us: int,
    days: int,
    end: datetime.datetime | None = None,
) -> x509.CertificateBuilder:
    now = datetime.datetime.fromtimestamp(now_us // 1_000_000, datetime.UTC)
    until = now + datetime.timedelta(days=days)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - BACKDATED)
        .not_valid_after(until if end is None else min(until, end))
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )


def _name(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _key_usage(*, signs_certificates: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs_certificates,
        key_cert_sign=signs_certificates,
        crl_sign=False,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _issued(certificate: x509.Certificate, key: ec.EllipticCurvePrivateKey, number: int) -> Issued:
    stated = Certificate(
        number=number,
        not_before_s=int(certificate.not_valid_before_utc.timestamp()),
        not_after_s=int(certificate.not_valid_after_utc.timestamp()),
        sha256=certificate.fingerprint(hashes.SHA256()).hex(),
    )
    key_pem = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    return Issued(stated, certificate.public_bytes(serialization.Encoding.PEM), key_pem)
