"""A TAK-like server and its certificates, made from TAK's public description with cryptography and the standard ssl.

A thread with its own loop: it demands a client certificate, reads events up to </event>, and keeps them.
"""

import asyncio
import contextlib
import datetime as dt
import ipaddress
import socket
import ssl
import threading

import pytak
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    NoEncryption,
    PrivateFormat,
    pkcs12,
)

DAY = dt.timedelta(days=1)


class Authority:
    """A private certificate authority, as every TAK server has one."""

    def __init__(self, name="TAK test authority"):
        self.key = ec.generate_private_key(ec.SECP256R1())
        self.name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
        self.certificate = self._sign(self.name, self.key.public_key(), -30 * DAY, 300 * DAY, is_ca=True)

    def issue(self, name, begins=-DAY, ends=300 * DAY, addresses=("127.0.0.1",)):
        """(certificate, key) for a name."""
        key = ec.generate_private_key(ec.SECP256R1())
        subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
        names = [x509.DNSName(name), *(x509.IPAddress(ipaddress.ip_address(each)) for each in addresses)]
        return self._sign(subject, key.public_key(), begins, ends, names=names), key

    def _sign(self, subject, public_key, begins, ends, *, is_ca=False, names=()):
        now = dt.datetime.now(dt.UTC)
        builder = (
            x509.CertificateBuilder()
            .subject_name(subject)
            .issuer_name(self.name)
            .public_key(public_key)
            .serial_number(x509.random_serial_number())
            .not_valid_before(now + begins)
            .not_valid_after(now + ends)
            .add_extension(x509.BasicConstraints(ca=is_ca, path_length=None), critical=True)
        )
        if names:
            builder = builder.add_extension(x509.SubjectAlternativeName(names), critical=False)
        return builder.sign(self.key, hashes.SHA256())


def pem(thing, password=None):
    """PEM of a certificate or key."""
    if isinstance(thing, x509.Certificate):
        return thing.public_bytes(Encoding.PEM)
    encryption = NoEncryption() if password is None else BestAvailableEncryption(password.encode())
    return thing.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, encryption)


def p12(certificate, key, password, authorities=()):
    """A .p12 file."""
    encryption = BestAvailableEncryption(password.encode())
    return pkcs12.serialize_key_and_certificates(b"unit", key, certificate, authorities or None, encryption)


def package(path, host, port, ca_p12, client_p12, password, layout="atak"):
    """A data package as PyTAK makes it for a client. ``layout``: atak, with a folder, or itak, without one."""
    preferences = pytak.build_connection_config_pref_xml(
        stream_description="Search",
        streaming_host=host,
        streaming_port=port,
        ca_password=password,
        client_password=password,
        location_callsign="unit",
        package_layout=layout,
    )
    manifest = pytak.build_connection_manifest_xml(uid="1", display_name="Search", package_layout=layout)
    made = pytak.build_connection_data_package_zip(
        config_pref_xml=preferences,
        manifest_xml=manifest,
        client_p12_path=str(client_p12),
        trust_p12_path=str(ca_p12),
        package_layout=layout,
    )
    path.write_bytes(made)


class TakServer:
    """A TLS server on 127.0.0.1. ``behaviour``: reads | never_reads | closes."""

    def __init__(self, folder, authority, certificate, key, behaviour="reads", client_ca=None):
        chain = folder / f"server-{certificate.serial_number}.pem"
        chain.write_bytes(pem(key) + pem(certificate))
        self.context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self.context.load_cert_chain(chain)
        self.context.load_verify_locations(cadata=pem((client_ca or authority).certificate).decode())
        self.context.verify_mode = ssl.CERT_REQUIRED
        self._behaviour = behaviour
        self.events = []
        self.clients = []
        self.port = 0

    def __enter__(self):
        self._ready = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()), daemon=True)
        self._thread.start()
        assert self._ready.wait(10)
        return self

    def __exit__(self, *_exc):
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(10)

    async def _run(self):
        self._loop, self._stop, self._writers = asyncio.get_running_loop(), asyncio.Event(), []
        self._loop.set_exception_handler(lambda *_: None)
        server = await asyncio.start_server(self._serve, "127.0.0.1", 0, ssl=self.context)
        self.port = server.sockets[0].getsockname()[1]
        self._ready.set()
        await self._stop.wait()
        server.close()
        for writer in self._writers:
            writer.transport.abort()
        await asyncio.sleep(0.05)

    async def _serve(self, reader, writer):
        self.clients.append(writer.get_extra_info("peercert"))
        self._writers.append(writer)
        if self._behaviour == "closes":
            writer.close()
            return
        if self._behaviour == "never_reads":
            writer.transport.pause_reading()
            await self._stop.wait()
        with contextlib.suppress(asyncio.IncompleteReadError, OSError):
            while True:
                self.events.append(await reader.readuntil(b"</event>"))


@contextlib.contextmanager
def refusing_server(server):
    """The port of a server with the certificates of ``server`` whose OpenSSL refuses clients by an alert.

    asyncio's server closes without one; the servers of TAK do not.
    """
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(10)

        def serve():
            connection, _ = listener.accept()
            connection.settimeout(10)
            with connection, contextlib.suppress(OSError), server.context.wrap_socket(connection, server_side=True):
                pass

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield listener.getsockname()[1]
        thread.join(10)
