"""Certificates of a TLS client: PEM and PKCS #12 files, or a TAK data package, as an SSL context.

The standard library reads PEM alone; for .p12 the extra ``tak`` brings ``cryptography``. Errors name the key of the
configuration and the file, and never contain a password.
"""

from __future__ import annotations

import os
import ssl
import tempfile
from pathlib import Path
from typing import Final

import msgspec

from fwav_companion.errors import UserError
from fwav_companion.libraries import require

PKCS12_SUFFIXES: Final = (".p12", ".pfx")
MOST_BYTES: Final = 1_000_000
"""Largest certificate file: real ones have some kilobytes."""


class TlsFiles(msgspec.Struct, frozen=True, kw_only=True):
    """The contents of the files of a TLS client."""

    client: bytes = b""
    """Certificate, PEM or PKCS #12; b"": none."""
    client_key: bytes = b""
    """Private key, PEM; b"": it is in ``client``."""
    client_password: str = ""
    ca: bytes = b""
    """Authorities of the server, PEM or PKCS #12; b"": those of the system."""
    ca_password: str = ""


def read_files(*, client: str, client_key: str, password_file: str, ca: str) -> TlsFiles:
    """The contents of the files; "" for a file that is not given. UserError names the first that cannot be read."""
    if client_key and not client:
        raise UserError("cot_client_key without cot_client_cert: accepted: both, or a certificate that holds its key")
    password = _content("cot_password_file", password_file).decode(errors="replace").strip("\r\n")
    return TlsFiles(
        client=_content("cot_client_cert", client),
        client_key=_content("cot_client_key", client_key),
        client_password=password,
        ca=_content("cot_ca", ca),
        ca_password=password,
    )


def client_context(files: TlsFiles) -> ssl.SSLContext:
    """A context that verifies the server and shows this unit's certificate. UserError in one line."""
    context = ssl.create_default_context()
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    if files.ca:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)  # without the system's authorities; verifies by default
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        pem = files.ca if _is_pem(files.ca) else _pem_of_pkcs12("cot_ca", files.ca, files.ca_password)[1]
        try:
            context.load_verify_locations(cadata=pem.decode("ascii"))
        except (ssl.SSLError, ValueError):
            raise UserError("cot_ca: not a certificate; accepted: PEM, or .p12 with its password") from None
    if files.client:
        _load_client(context, files)
    return context


def _load_client(context: ssl.SSLContext, files: TlsFiles) -> None:
    if _is_pem(files.client):
        key, certificate = files.client_key or files.client, files.client
    else:
        key, certificate = _pem_of_pkcs12("cot_client_cert", files.client, files.client_password)
    # OpenSSL loads a client's chain from files alone; these are readable by this user only, and are gone at once.
    with tempfile.TemporaryDirectory(prefix="fwav-tls-") as folder:
        chain, secret = Path(folder, "chain.pem"), Path(folder, "key.pem")
        for path, content in ((chain, certificate), (secret, key)):
            with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
                file.write(content)
        try:
            context.load_cert_chain(chain, secret, password=lambda: files.client_password)
        except ssl.SSLError as error:
            raise UserError(_why_not_loaded(error, has_password=bool(files.client_password))) from None
        except ValueError as error:  # of a password that OpenSSL cannot take
            raise UserError(f"cot_password_file: {error}; accepted: the password of the key") from None


def _why_not_loaded(error: ssl.SSLError, *, has_password: bool) -> str:
    if error.reason == "KEY_VALUES_MISMATCH":
        return "cot_client_key: not the key of cot_client_cert; accepted: the key that it was made with"
    hint = "with the right password" if has_password else "with cot_password_file where the key is encrypted"
    return f"cot_client_cert, cot_client_key: not readable; accepted: PEM {hint}, or .p12"


def _pem_of_pkcs12(key: str, content: bytes, password: str) -> tuple[bytes, bytes]:
    """(private key or b"", certificates), PEM, of a PKCS #12 file."""
    require(f"{key}: a .p12 file", "cryptography")
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat, pkcs12

    try:
        store = pkcs12.load_pkcs12(content, password.encode() or None)
    except ValueError:
        raise UserError(f"{key}: not a .p12 file with this password; accepted: PEM, or .p12 and its password") from None
    found = [*([store.cert] if store.cert is not None else []), *store.additional_certs]
    secret = b""
    if store.key is not None:
        secret = store.key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    if not found:
        raise UserError(f"{key}: the .p12 file holds no certificate; accepted: one with its certificate")
    return secret, b"".join(each.certificate.public_bytes(Encoding.PEM) for each in found)


def _is_pem(content: bytes) -> bool:
    return b"-----BEGIN" in content


def _content(key: str, path: str) -> bytes:
    if not path:
        return b""
    try:
        with Path(path).open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise UserError(f"{key} {path}: {error.strerror or error}") from None
    if not content or len(content) > MOST_BYTES:
        raise UserError(f"{key} {path}: {'empty' if not content else 'too large'}; accepted: PEM or .p12")
    return content
