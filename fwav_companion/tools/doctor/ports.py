"""The ways in and out: is the device there, may we have it, who else has it, and is it MAVLink that comes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from fwav_companion.config import LinkConfig
from fwav_companion.tools.doctor.advice import garbled, lossy, unheard
from fwav_companion.tools.doctor.evidence import Evidence, SerialPort
from fwav_companion.tools.doctor.finding import Finding, Level

GARBAGE_BYTES: Final = 500
"""Fewer bytes that are no MAVLink may be a cable being plugged, or a boot loader's greeting."""
GARBAGE_SHARE: Final = 0.2
"""Of the bytes. A line at the right speed loses single frames, never a fifth."""
LOSS: Final = 0.02
"""Of the frames: beyond, attitudes are missing where they are needed."""
LOSS_FRAMES: Final = 50


def ports(evidence: Evidence) -> Iterator[Finding]:
    """All links."""
    known = {port.link: port for port in evidence.board.ports}
    for link in evidence.config.link:
        port = known.get(link.name)
        if port is not None:
            yield from _serial(port, evidence.board.user)
        yield from _state(evidence, link, port)


def _serial(port: SerialPort, user: str) -> Iterator[Finding]:
    where = f"link {port.link}"
    if not port.exists:
        there = f"; there are {', '.join(port.others)}" if port.others else "; there is no serial device at all"
        yield Finding(
            "port_missing", Level.STOPS, where, f"{port.device} is not there{there}",
            "plug it in, or set [[link]] url to one that is; on a Raspberry Pi, enable_uart=1 in config.txt",
        )  # fmt: skip
    elif not port.allowed:
        yield Finding(
            "port_permission", Level.STOPS, where,
            f"{port.device} may not be read and written by {user or 'this user'}",
            f"sudo usermod -aG {port.group or 'dialout'} {user or '$USER'}, then log in again",
        )  # fmt: skip
    if port.console:
        yield Finding(
            "serial_console", Level.STOPS, where, f"the kernel's console is on {port.device} ({port.console})",
            f"take console={port.name} out of cmdline.txt (raspi-config: serial login shell off), and reboot",
        )  # fmt: skip
    if port.bluetooth:
        yield Finding(
            "bluetooth_on_port", Level.STOPS, where, f"Bluetooth has {port.device} ({port.bluetooth})",
            "dtoverlay=disable-bt in config.txt, sudo systemctl disable hciuart, reboot",
        )  # fmt: skip
    elif port.mini_uart and port.baud > 115_200:
        yield Finding(
            "mini_uart", Level.HARMS, where,
            f"{port.device} is the mini UART: its speed follows the core's clock, at {port.baud} baud bytes are lost",
            "dtoverlay=disable-bt in config.txt gives serial0 the full UART",
        )  # fmt: skip


def _state(evidence: Evidence, link: LinkConfig, port: SerialPort | None) -> Iterator[Finding]:
    state, why = evidence.ask("links", link.name, "state"), evidence.ask("links", link.name, "why") or ""
    if state == "down" and (port is None or (port.exists and port.allowed)):
        yield _down(evidence, link, why)
    if state == "up" and link.role == "autopilot":
        yield from _heard(evidence, link, evidence.traffic(link.name))


def _down(evidence: Evidence, link: LinkConfig, why: str) -> Finding:
    where, holder = f"link {link.name}", evidence.board.holders.get(link.name, "")
    level = Level.STOPS if link.role == "autopilot" else Level.HARMS
    if "in use" in why or "busy" in why or holder:
        by = f" by {holder}" if holder else ""
        return Finding(
            "port_taken", level, where, f"{link.url} is taken{by} ({why})", "end that program, or use another port"
        )
    return Finding("link_down", level, where, f"{link.url}: {why}", "see that the other end is there and the URL right")


def _heard(evidence: Evidence, link: LinkConfig, traffic: Mapping[str, Any]) -> Iterator[Finding]:
    where, bytes_in = f"link {link.name}", int(traffic.get("bytes_in") or 0)
    skipped, peers = int(traffic.get("skipped_bytes") or 0), traffic.get("peers") or ()
    if bytes_in == 0:
        yield Finding("nothing_heard", Level.STOPS, where, f"not a byte came by {link.url}", unheard(link.parsed_url))
    elif skipped > GARBAGE_BYTES and skipped > GARBAGE_SHARE * bytes_in:
        yield _garbage(link, where, bytes_in, skipped, level=Level.HARMS if peers else Level.STOPS)
    if int(traffic.get("echoes") or 0) > 0:
        yield Finding(
            "echo", Level.HARMS, where, f"{traffic['echoes']} of our own frames came back",
            "a crossed wire (RX to our own TX), or a router that sends back: take it out of the loop",
        )  # fmt: skip
    yield from _loss(where, peers, lossy(link.parsed_url))
    yield from _signatures(evidence, link, traffic)


def _garbage(link: LinkConfig, where: str, bytes_in: int, skipped: int, *, level: Level) -> Finding:
    share = round(100 * skipped / bytes_in)
    what = f"{share} % of {bytes_in} bytes are no MAVLink"
    return Finding("garbage", level, where, what, garbled(link.parsed_url))


def _loss(where: str, peers: Any, do: str) -> Iterator[Finding]:
    for peer in peers:
        received, lost = int(peer.get("received") or 0), int(peer.get("lost") or 0)
        if received >= LOSS_FRAMES and lost > LOSS * (received + lost):
            share = 100.0 * lost / (received + lost)
            yield Finding(
                "loss", Level.HARMS, where,
                f"{share:.1f} % of the frames of {peer['system']}/{peer['component']} are lost", do,
            )  # fmt: skip


def _signatures(evidence: Evidence, link: LinkConfig, traffic: Mapping[str, Any]) -> Iterator[Finding]:
    where = f"link {link.name}"
    level = Level.STOPS if evidence.autopilot is None else Level.HARMS
    if int(traffic.get("refused_signatures") or 0) > 0:
        yield Finding(
            "wrong_signature", level, where,
            f"{traffic['refused_signatures']} frames are signed with another key, or with a clock far behind",
            "give autopilot and [signing] key_file the same key; see that both know the time",
        )  # fmt: skip
    elif int(traffic.get("refused_unsigned") or 0) > 0:
        yield Finding(
            "unsigned", level, where,
            f"{traffic['refused_unsigned']} frames came unsigned and were not believed, since [signing] is set",
            f'set the key in the autopilot, or [signing] accept_unsigned = ["{link.name}"] where the wire is trusted',
        )  # fmt: skip
