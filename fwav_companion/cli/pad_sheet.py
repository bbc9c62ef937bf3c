"""``fwav-companion check --pad FILE``: the sheets of the configured pads, to print at true size."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from fwav_companion.errors import ConfigError, UserError
from fwav_companion.libraries import require
from fwav_companion.on_disk import whole

if TYPE_CHECKING:
    from fwav_companion.config import Config

DICTIONARY = "4x4_50"
"""Dictionary of ArUco markers without [vision]."""


def run_pad_sheet(config: Config, path: Path, *, as_json: bool) -> int:
    """Write the sheets and say how to print them; returns the exit status."""
    require("check --pad", "numpy", "cv2")
    from fwav_companion.tools.pad_sheet.pdf_pages import page_count, pdf_of
    from fwav_companion.tools.pad_sheet.png_picture import png_of
    from fwav_companion.tools.pad_sheet.sheet import pad_sheet

    kind = path.suffix.lower()
    if kind not in (".pdf", ".png"):
        raise UserError(f"check --pad {path}: accepted: a name that ends in .pdf or .png")
    if not config.pad:
        raise ConfigError(f"{config.file}: [[pad]]: missing, while --pad prints it; accepted: at least one pad")
    if kind == ".png" and len(config.pad) > 1:
        raise UserError(f"check --pad {path}: a picture has one pad, [[pad]] has {len(config.pad)}; accepted: .pdf")
    dictionary = DICTIONARY if config.vision is None else config.vision.aruco_dictionary
    sheets = [pad_sheet(pad, dictionary) for pad in config.pad]
    data = pdf_of(sheets) if kind == ".pdf" else png_of(sheets[0])
    try:
        with whole(path) as file:
            file.write(data)
    except OSError as error:
        raise UserError(f"check --pad {path}: {error.strerror}; accepted: a file that can be written") from None
    written = []
    for sheet in sheets:
        rows, columns = page_count(sheet)
        pages = rows * columns if kind == ".pdf" else 1
        size = f"{sheet.width:.0f} x {sheet.height:.0f} mm"
        glue = ": cut along the frames, glue edge to edge" if pages > 1 else ""
        print(f"{sheet.name}: {size}, {pages} page{'s' if pages > 1 else ''}{glue}")
        written.append({"label": sheet.name, "width_mm": sheet.width, "height_mm": sheet.height, "pages": pages})
    print(f"{path}: print at 100 % (not fitted to the page), then measure the ruler and a tag's black square")
    if as_json:
        print(json.dumps({"ok": True, "file": str(path), "pads": written}))
    return 0
