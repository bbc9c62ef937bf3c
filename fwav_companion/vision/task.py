"""The task of the vision process: the [vision] table of the configuration. PURE, shared by both ends of its socket."""

from __future__ import annotations

from typing import Annotated, Final, Literal, TypeAlias

import msgspec
from msgspec import Meta

from fwav_companion.types import DeliveryReport
from fwav_companion.types.secrets import SecretPath, SecretUrl, redacted_url

ArucoDictionary: TypeAlias = Annotated[
    str,
    Meta(
        pattern=r"^(4x4|5x5|6x6|7x7)_(50|100|250|1000)$",
        description='"4x4_50" ... "7x7_1000": 4x4, 5x5, 6x6, 7x7 with 50, 100, 250, 1000 markers',
    ),
]
"""Modules along a side, and markers, of an ArUco dictionary of OpenCV."""


def dictionary_key(name: str) -> str:
    """A marker dictionary's or tag family's name in lower case without OpenCV's prefix: 4x4_50 for DICT_4X4_50."""
    return name.strip().lower().removeprefix("dict_")


ModelFormat: TypeAlias = Literal[
    "auto",
    "yolov5",
    "yolov8",
    "yolox",
    "yolov10",
    "yolonas",
    "rtdetr",
    "dfine",
    "rfdetr",
    "detr",
    "mmdeploy",
    "paddle",
    "torchvision",
    "tf",
    "nms7",
    "ssd",
]
Level: TypeAlias = Annotated[float, Meta(ge=0, le=255)]
Deviation: TypeAlias = Annotated[float, Meta(gt=0, le=1000)]
ThreeLevels: TypeAlias = tuple[Level, Level, Level]
ThreeDeviations: TypeAlias = tuple[Deviation, Deviation, Deviation]
Tiles: TypeAlias = Annotated[int, Meta(ge=1, le=16)]
SigmaPart: TypeAlias = Annotated[float, Meta(ge=0, le=100)]
BiasPart: TypeAlias = Annotated[float, Meta(ge=-1, le=1)]
SidePx: TypeAlias = Annotated[int, Meta(ge=16, le=32768)]
KeptPicturesRule: TypeAlias = Literal["detections"] | Annotated[int, Meta(ge=0, le=100_000)]
"""[record] pictures. 0: none; N: every Nth; ``detections``: those in which something was detected."""
KEPT_PICTURE: Final = b'{"kept":'
"""Prefix of a kept picture's message: its frame in the wire format without detections, and a closing brace, with the
descriptor of a file that has the JPEG."""
MOST_THREADS = 64


class VisionTask(msgspec.Struct, frozen=True):
    """[vision]: if present, this service opens a camera and detects targets itself."""

    source: Annotated[SecretUrl, Meta(min_length=1)] = "libcamera:0"
    """libcamera:N, /dev/videoN, rtsp://, udp://, or the path of a .sdp file, of a video, of a folder or of a named pipe
    of images with stamps. Paths are absolute in a task, and relative to the file in a configuration."""
    size: tuple[SidePx, ...] = ()
    """Width and height that are requested of a camera, pixels; empty: those of the calibration, which the service fills
    in."""
    fps: Annotated[float, Meta(ge=0, le=1000)] = 0.0
    """Frame rate that is requested of a camera, hertz; 0: the driver's own."""
    exposure_s: Literal["auto"] | Annotated[float, Meta(gt=0, le=1)] = "auto"
    """Exposure that is requested of a camera, seconds."""
    gain: Literal["auto"] | Annotated[float, Meta(gt=0, le=1000)] = "auto"
    """Gain that is requested of a camera: libcamera's AnalogueGain, V4L2's own units."""
    python: str = ""
    """Interpreter of the vision process; "": that of the service. A path or a name, as python3."""
    detector: Literal["apriltag", "aruco", "color", "onnx", "none"] = "apriltag"
    """Detector of the targets."""
    apriltag_family: Literal["16h5", "25h9", "36h10", "36h11"] = "36h11"
    """Family of ``apriltag``."""
    aruco_dictionary: ArucoDictionary = "4x4_50"
    """Dictionary of ``aruco``: OpenCV's name in lower case. In a configuration also OpenCV's DICT_4X4_50."""
    color_hue_deg: Annotated[float, Meta(ge=-360, le=360)] = 0.0
    """Hue of ``color``, degrees: 0 red, 60 yellow, 120 green, 240 blue."""
    model: str = ""
    """Path of the model of ``onnx``."""
    model_format: ModelFormat = "auto"
    """Layout of the model's outputs; ``auto``: by the file's metadata, names, types, shapes and first outputs.
    ``yolov8`` is also v9, 11 and 12, ``yolov10`` also 26 and what is exported end to end, ``dfine`` also DEIM."""
    model_size: Literal["auto"] | tuple[SidePx, SidePx] = "auto"
    """Width and height of the model's input where the file leaves them open; ``auto``: those of its metadata."""
    model_resize: Literal["auto", "letterbox", "letterbox_topleft", "stretch"] = "auto"
    """How a picture fills the input: with margins on both sides, at the right and bottom, or none; ``auto``: as the
    model's family does."""
    model_normalize: Literal["auto", "none", "255", "imagenet"] | tuple[ThreeLevels, ThreeDeviations] = "auto"
    """Values of the input: levels of 0 to 255, divided by 255, or less a mean and over a deviation in the order of its
    colours; ``auto``: as the model's family does."""
    model_background: Literal["auto", "none", "first", "last"] = "auto"
    """The class slot that is not a class; ``auto``: as the model's family has it."""
    model_tiles: tuple[Tiles, Tiles] = (1, 1)
    """Columns and rows of overlapping slices, for small things from height."""
    model_sigma: Literal["auto"] | tuple[SigmaPart, SigmaPart] = "auto"
    """One sigma of a box's centre: pixels of the model's input, and share of the box's side; ``auto``: a prior, 0.5
    and 0.03. `detect --sigma` measures it."""
    model_bias: tuple[BiasPart, BiasPart] = (0.0, 0.0)
    """How far a box's centre lies right of and below the thing's, as shares of its width and height: subtracted."""
    model_input: Literal["auto", "rgb", "bgr", "rgb255", "bgr255"] = "auto"
    """Order of the model's colours, and their range: 0 to 1 or 0 to 255. ``model_normalize`` overrides the range."""
    model_labels: tuple[str, ...] = ()
    """Labels of the model's classes where its file has none, in their order."""
    model_confidence: Annotated[float, Meta(ge=0, le=1)] = 0.25
    """Least score of a detection of the model."""
    model_iou: Annotated[float, Meta(ge=0, le=1)] = 0.45
    """Largest overlap of two boxes of one label, intersection over union; of two nearer ones the better is kept."""
    threads: Annotated[int, Meta(ge=1, le=MOST_THREADS)] = 1
    """Number of threads of the detector."""
    stream_clock: Literal["arrival", "utc"] = "arrival"
    """Clock of a stream's stamps. ``arrival``: the server's clock is mapped to this board's by the arrivals; ``utc``:
    both are UTC."""
    track_clicks: bool = True
    """Whether an operator's click on anything starts a tracker of that patch."""
    preview: SecretPath = ""
    """HOST:PORT at which a browser sees the pictures; "": nowhere."""


def shown_source(task: VisionTask) -> str:
    """The source in a form for logs and reports."""
    return redacted_url(task.source)


class VisionOrders(msgspec.Struct, frozen=True):
    """The first message to the vision process: what it does until its end. The task may have a password and a token."""

    task: VisionTask
    """What to open, and how to detect."""
    kept: KeptPicturesRule
    """Which pictures to send as JPEG."""
    pad_tags: tuple[str, ...] = ()
    """Labels of the tags of pads, each detected under its own label."""


class VisionState(msgspec.Struct, frozen=True):
    """State of the vision process, sent between its frames."""

    vision: Literal["looking", "lost", "ended", "frozen", "stopped"]
    """Whether frames come, the camera is lost, the source has ended, the camera repeats one picture, or the detector
    cannot work as it is configured."""
    why: str = ""
    """Reason why it does not look."""
    delivery: DeliveryReport | None = None
    """Statistics of the camera's delivery."""
