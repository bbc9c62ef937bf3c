"""Pads in the pipeline: which labels are used, what is reported of a contradicting tag, and when nothing is loaded."""

from flying import CAMERA, LINK, Companion

from fwav_companion.camera import parse_calibration
from fwav_companion.config import parse
from fwav_companion.pipeline.pad_notices import FEWEST, PadNotices
from fwav_companion.pipeline.pipeline_factory import make_pairer
from fwav_companion.types import Detection, NoticeCode, PadContradiction, Ray, Reason

CAMERA_TABLE = '[camera]\ncalibration = "camera.yaml"\n'
PAD = '[[pad]]\nlabel = "pad"\ntags = [{ label = "tag36h11:0", size_m = 0.4 }]\n'


class Contradicting:
    """Pads of which one tag contradicts."""

    def __init__(self, **changes):
        usual = {"pad": "pad", "tag": "tag36h11:3", "off_m": 0.213, "corner_off_m": 0.22, "pictures": FEWEST}
        self.contradictions = [PadContradiction(**usual | changes)]


def test_contradicting_tag_is_named_once_with_its_distance():
    notices = PadNotices(Contradicting())
    (notice,) = notices.notices()
    assert notice.code is NoticeCode.PAD_CONTRADICTED
    assert notice.to_ground
    assert notice.text.startswith("tag36h11:3 lies 0.21 m from where pad has it")
    assert notices.notices() == ()


def test_turned_tag_is_not_said_to_lie_elsewhere():
    (notice,) = PadNotices(Contradicting(off_m=0.004)).notices()
    assert notice.text.startswith("tag36h11:3 is turned, or of another size than pad has it")


def test_tag_that_contradicts_in_few_pictures_is_not_reported():
    assert PadNotices(Contradicting(pictures=FEWEST - 1)).notices() == ()
    assert PadNotices(None).notices() == ()


def test_labels_that_are_used_include_the_tags_of_a_pad_among_them():
    calibration = parse_calibration(CAMERA, "camera.yaml")
    for labels, used in ((["pad"], True), (["person"], False), ([], True)):
        detections = f"[detections]\nlabels = {labels}\n".replace("'", '"')
        pairer = make_pairer(parse(LINK + CAMERA_TABLE + detections + PAD, "f.toml"), calibration)
        ray = pairer._rays.selected(Detection(320.0, 240.0, label="tag36h11:0"))
        assert isinstance(ray, Ray) if used else ray is Reason.OTHER_LABEL


def test_pads_are_made_only_where_the_configuration_has_one():
    for text, made in (
        (PAD, True),
        ('[[target]]\nlabel = "a"\nsize_m = 0.2\n', True),
        ('[[target]]\nlabel = "a"\n', False),
    ):
        camera = Companion(text=LINK + CAMERA_TABLE + text).pipeline._components.camera
        assert (camera._pads is not None) is made
