"""Invalid files of true places: one line with the accepted form, never a traceback."""

import pytest

from fwav_companion.errors import InputFileError
from fwav_companion.recording.truth import parse_truth


@pytest.mark.parametrize(
    "text",
    [
        "label,lat,lon,alt_amsl\na,48.1\rb,11.5,500\n",
        '{"label": "a", "north": ' + "[" * 5000,
        '{"label": "a", "north": 1' + "0" * 400 + ', "east": 2, "down": 3}',
        'label,north,east,down\n"' + "x" * 200_000 + '",1,2,3\n',
        "label,north,east,down\na,1,2,inf\n",
        "label,lat,lon,alt_amsl\na,91,11.5,500\n",
        "label,lat,lon,alt_amsl\na,48.1,1e3,500\n",
        "",
    ],
    ids=["new-line inside", "deep", "huge", "long", "not finite", "beyond the pole", "round the world", "empty"],
)
def test_a_truth_file_of_another_form_is_one_line(text):
    with pytest.raises(InputFileError, match="accepted: ") as reported:
        parse_truth(text, "truth")
    assert "\n" not in str(reported.value)


@pytest.mark.parametrize(
    "text", ["label,north,east,down\npad,1,2,3\n", '{"label": "pad", "north": 1, "east": 2, "down": 3}']
)
def test_a_byte_order_mark_belongs_to_no_column(text):
    (point,) = parse_truth("\ufeff" + text, "truth")
    assert (point.label, point.ned) == ("pad", (1.0, 2.0, 3.0))
