"""The rules that involve several keys. Each error names the key to change."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Final

from msgspec.structs import replace

from fwav_companion.acting.options import ActTable
from fwav_companion.config.document import Document
from fwav_companion.config.inputs import MountConfig
from fwav_companion.config.key_errors import Complaint, printable
from fwav_companion.config.pad_rules import motion_fault, pad_complaints
from fwav_companion.fleet.options import FUSION_NAME
from fwav_companion.links.url import (
    LinkUrl,
    SerialUrl,
    UdpUrl,
    UrlError,
    parse_cot_url,
    parse_detections_url,
    parse_link_url,
)
from fwav_companion.types.spots import CLICK_LABEL
from fwav_companion.vision.preview_address import parse_preview
from fwav_companion.vision.source_names import source_kind
from fwav_companion.vision.task import VisionTask

CAMERA_COMPONENT_ID: Final = 100
"""MAV_COMP_ID_CAMERA: the second component of this service, where camera_tracking is on."""

GROUND_STATION_SYSTEM_ID: Final = 255
"""System id that ground stations have unless they are configured otherwise."""
MOST_LANDMARKS: Final = 32
"""Most landmarks: each adds three states to a filter whose cost grows with the square of their number."""

LISTENING: Final = frozenset({"udpin", "tcpin"})
"""Kinds of links that bind the port of their URL."""
ANY_IPV4: Final = "0.0.0.0"  # noqa: S104
"""Address of all interfaces; only compared with addresses, not bound."""


def broken_rules(document: Document) -> Iterator[Complaint]:
    """Each rule between keys that the document breaks, in the file's order."""
    yield from _urls(document)
    yield from _links(document)
    yield from _listeners(document)
    yield from _vehicle_and_camera(document)
    if document.vision is not None:
        yield from _vision(document.vision)
    elif document.record.pictures != 0:
        yield ("record", "pictures"), "there is no [vision], whose pictures would be kept; accepted: 0"
    yield from _targets(document)
    yield from pad_complaints(document)
    yield from _landmarks(document)
    yield from _ground_and_publish(document)
    if document.act is not None:
        yield from _act(document, document.act)
    if document.fleet is not None and document.fleet.vehicle == FUSION_NAME:
        yield ("fleet", "vehicle"), "the name of the targets that `ground` fuses; accepted: a name of its own"


def _urls(document: Document) -> Iterator[Complaint]:
    for index, link in enumerate(document.link):
        yield from _url(("link", index, "url"), link.url, parse_link_url)
    if document.detections.url:
        yield from _url(("detections", "url"), document.detections.url, parse_detections_url)
    if document.publish.cot:
        yield from _url(("publish", "cot"), document.publish.cot, parse_cot_url)


def _listeners(document: Document) -> Iterator[Complaint]:
    """Ports and devices that this file would open twice: the second opening would be retried for ever."""
    opened: list[tuple[str, LinkUrl]] = []
    for index, link in enumerate(document.link):
        url = parse_link_url(link.url)
        if (other := _opened_already(opened, url)) is not None:
            yield ("link", index, "url"), f"{other} opens this already; accepted: a port or device of its own"
        opened.append((f'[[link]] "{printable(link.name)}"', url))
    detections = parse_detections_url(document.detections.url) if document.detections.url else None
    if isinstance(detections, UdpUrl) and (other := _opened_already(opened, detections)) is not None:
        yield ("detections", "url"), f"{other} opens {detections} already; accepted: a port or device of its own"


def _opened_already(opened: Sequence[tuple[str, LinkUrl]], url: LinkUrl) -> str | None:
    return next((name for name, earlier in opened if _is_one_opening(earlier, url)), None)


def _is_one_opening(one: LinkUrl, other: LinkUrl) -> bool:
    """Whether both open the same device, or listen on the same port."""
    if isinstance(one, SerialUrl) or isinstance(other, SerialUrl):
        both = isinstance(one, SerialUrl) and isinstance(other, SerialUrl)
        return both and replace(one, baud=0) == replace(other, baud=0)
    if one.kind != other.kind or one.kind not in LISTENING or one.port != other.port:
        return False
    hosts = {one.host, other.host}
    return len(hosts) == 1 or (ANY_IPV4 in hosts and not any(":" in host for host in hosts))


def _url(path: tuple[str | int, ...], text: str, parse: Callable[[str], object]) -> Iterator[Complaint]:
    try:
        parse(text)
    except UrlError as error:
        yield path, str(error)


def _links(document: Document) -> Iterator[Complaint]:
    names = [link.name for link in document.link]
    for index, name in enumerate(names):
        if name in names[:index]:
            yield ("link", index, "name"), "another [[link]] has this name; accepted: a name of its own"
    if document.signing is None:
        return
    for index, name in enumerate(document.signing.accept_unsigned):
        if name not in names:
            yield ("signing", "accept_unsigned", index), f"no [[link]] has this name; accepted: {', '.join(names)}"


def _vehicle_and_camera(document: Document) -> Iterator[Complaint]:
    if document.publish.camera_tracking and document.vehicle.component_id == CAMERA_COMPONENT_ID:
        yield (
            ("vehicle", "component_id"),
            f"{CAMERA_COMPONENT_ID} is the camera component's while [publish] camera_tracking is on; accepted: another",
        )
    mount = document.camera.mount
    if mount.gimbal_device_id and mount.pitch_deg == MountConfig().pitch_deg:
        yield (
            ("camera", "mount", "pitch_deg"),
            "on a gimbal the angles count from its own axes; accepted: 0.0 for a camera that looks where it does",
        )
    if not document.camera.calibration and (document.detections.url or document.vision is not None):
        source = "[vision] opens a camera" if document.vision is not None else "[detections] url brings pixels"
        yield (
            ("camera", "calibration"),
            f'missing, while {source}; accepted: the path of a camera file (for a relay alone: [detections] url = "")',
        )


def _vision(vision: VisionTask) -> Iterator[Complaint]:
    for key, text, parse in (("source", vision.source, source_kind), ("preview", vision.preview, parse_preview)):
        try:
            parse(text)
        except ValueError as error:
            yield ("vision", key), str(error)
    if len(vision.size) not in (0, 2):
        yield ("vision", "size"), "accepted: [] or [width, height], as [640, 480]"
    if vision.detector == "onnx" and not vision.model:
        yield ("vision", "model"), 'missing, while detector = "onnx"; accepted: the path of an .onnx file'


def _targets(document: Document) -> Iterator[Complaint]:
    labels = [target.label for target in document.target]
    for index, label in enumerate(labels):
        if label in labels[:index]:
            yield ("target", index, "label"), "another [[target]] has this label; accepted: a label of its own"
    for index, target in enumerate(document.target):
        if fault := motion_fault(target.motion, document.tracking):
            yield ("target", index, "motion"), fault


def _landmarks(document: Document) -> Iterator[Complaint]:
    labels = [landmark.label for landmark in document.landmark]
    for index, label in enumerate(labels):
        if label in labels[:index]:
            yield ("landmark", index, "label"), "another [[landmark]] has this label; accepted: a label of its own"
        if label in (target.label for target in document.target):
            yield ("landmark", index, "label"), "a [[target]] has this label; accepted: a label of its own"
        if index >= MOST_LANDMARKS:
            yield ("landmark", index, "label"), f"accepted: at most {MOST_LANDMARKS} landmarks"
            return


def _ground_and_publish(document: Document) -> Iterator[Complaint]:
    if document.ground.terrain and not document.ground.terrain_datum:
        yield (
            ("ground", "terrain_datum"),
            "missing, while [ground] terrain names files, which do not contain it; accepted: egm96, egm2008, ellipsoid",
        )
    if document.ground.model == "altitude" and document.ground.alt_amsl is None:
        yield (("ground", "alt_amsl"), 'missing, while [ground] model is "altitude"; accepted: metres above sea level')
    if document.publish.landing_label == CLICK_LABEL:
        yield (("publish", "landing_label"), f'"{CLICK_LABEL}" is of clicked spots, which never steer a landing')
    if document.publish.landing_target and not document.publish.landing_label:
        yield (
            ("publish", "landing_label"),
            "missing, while [publish] landing_target is on; accepted: the label of the target to land on",
        )


def _act(document: Document, act: ActTable) -> Iterator[Complaint]:
    """What [act] needs of other tables, and the system ids that another sender has."""
    if act.acts and not document.publish.camera_tracking:
        yield (
            ("publish", "camera_tracking"),
            "false, while [act] acts on the target that an operator selects by it; accepted: true",
        )
    if act.acts and not document.camera.calibration:
        yield ("camera", "calibration"), "missing, while [act] acts on a target; accepted: the path of a camera file"
    if act.point == "gimbal" and not document.camera.mount.gimbal_device_id:
        yield (
            ("camera", "mount", "gimbal_device_id"),
            '0, while [act] point = "gimbal"; accepted: the gimbal that carries the camera',
        )
    if act.follow_system_id == GROUND_STATION_SYSTEM_ID:
        yield ("act", "follow_system_id"), "255 is the ground stations'; accepted: an id that no other sender has"
    if act.follow_system_id and act.follow_system_id == document.vehicle.system_id:
        yield (
            ("act", "follow_system_id"),
            "the vehicle's own id, which ArduPilot does not follow; accepted: another, or 0 for PX4",
        )
