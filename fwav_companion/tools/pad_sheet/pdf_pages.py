"""A pad's sheet as a PDF of A4 pages: one where it fits, else tiles to be cut and glued edge to edge. PDF 32000-1."""

from __future__ import annotations

from math import ceil
from typing import Final

from fwav_companion.tools.pad_sheet.sheet import CAPTION_MM, Polygon, Sheet

POINTS_PER_MM: Final = 72.0 / 25.4
PAGE_MM: Final = (210.0, 297.0)
"""A4, upright."""
MARGIN_MM: Final = 10.0
"""Border that printers leave white."""
FOOT_MM: Final = 24.0
"""Height of the ruler and its text below the sheet."""
TILE_MM: Final = (PAGE_MM[0] - 2.0 * MARGIN_MM, PAGE_MM[1] - 2.0 * MARGIN_MM - FOOT_MM)
"""Part of the sheet on one page."""
RULER_MM: Final = 150
"""Length of the ruler."""


def pdf_of(sheets: list[Sheet]) -> bytes:
    """The file with the pages of all sheets."""
    pages = [page for sheet in sheets for page in _pages(sheet)]
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        b"<< /Type /Pages /Kids [%s] /Count %d >>"
        % (b" ".join(b"%d 0 R" % (4 + 2 * k) for k in range(len(pages))), len(pages)),
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    width, height = (POINTS_PER_MM * side for side in PAGE_MM)
    for number, page in enumerate(pages):
        box = f"[0 0 {width:.3f} {height:.3f}]".encode()
        resources = b"<< /Font << /F1 3 0 R >> >>"
        objects.append(
            b"<< /Type /Page /Parent 2 0 R /MediaBox %s /Resources %s /Contents %d 0 R >>"
            % (box, resources, 5 + 2 * number)
        )
        objects.append(b"<< /Length %d >>\nstream\n%s\nendstream" % (len(page), page))
    return _file(objects)


def page_count(sheet: Sheet) -> tuple[int, int]:
    """Rows and columns of the pages of a sheet."""
    return max(1, ceil(sheet.height / TILE_MM[1] - 1e-9)), max(1, ceil(sheet.width / TILE_MM[0] - 1e-9))


def _pages(sheet: Sheet) -> list[bytes]:
    """The content of each page of a sheet."""
    rows, columns = page_count(sheet)
    alone = rows == columns == 1
    pages = []
    for row in range(rows):
        for column in range(columns):
            left, top = sheet.left + column * TILE_MM[0], sheet.top + row * TILE_MM[1]
            if alone:  # in the middle of the page
                left -= 0.5 * (TILE_MM[0] - sheet.width)
                top -= 0.5 * (TILE_MM[1] - sheet.height)
            where = "" if alone else f", row {row + 1} of {rows}, column {column + 1} of {columns}"
            pages.append(_page(sheet, left, top, where, framed=not alone))
    return pages


def _page(sheet: Sheet, left: float, top: float, where: str, *, framed: bool) -> bytes:
    """The content of the page whose tile begins at a place of the sheet, millimetres."""
    k = POINTS_PER_MM
    lines = [
        "q",
        f"{k:.9f} 0 0 {-k:.9f} {k * MARGIN_MM:.6f} {k * (PAGE_MM[1] - MARGIN_MM):.6f} cm",  # millimetres, y downward
        "q",
        f"0 0 {TILE_MM[0]:.3f} {TILE_MM[1]:.3f} re W n",
        f"1 0 0 1 {-left:.6f} {-top:.6f} cm",
    ]
    black: list[Polygon] = []
    for polygon in sheet.polygons:
        if not polygon.black and black:
            lines.append(_filled(black, black=True))
            black = []
        if polygon.black:
            black.append(polygon)
        else:
            lines.append(_filled([polygon], black=False))
    if black:
        lines.append(_filled(black, black=True))
    lines += [_text(caption.at[0], caption.at[1], caption.text) for caption in sheet.captions]
    lines.append("Q")
    if framed:
        lines.append(f"0.1 w 0 0 {TILE_MM[0]:.3f} {TILE_MM[1]:.3f} re S")
    lines += _ruler(TILE_MM[1] + 8.0)
    hint = "print at 100 %, not fitted to the page; the ruler must be 150 mm long"
    lines.append(_text(0.0, TILE_MM[1] + 21.0, f"{sheet.name}{where}: {hint}"))
    lines.append("Q")
    return "\n".join(lines).encode("latin-1", "replace")


def _filled(polygons: list[Polygon], *, black: bool) -> str:
    """One path of several polygons, filled at once: no hairlines between neighbours."""
    path = []
    for polygon in polygons:
        first, *others = polygon.corners
        path.append(f"{first[0]:.4f} {first[1]:.4f} m")
        path += [f"{x:.4f} {y:.4f} l" for x, y in others]
        path.append("h")
    return "\n".join([f"{0 if black else 1} g", *path, "f"])


def _ruler(y: float) -> list[str]:
    """A ruler whose ticks hang down from a line, millimetres."""
    lines = [f"0.15 w 0 {y:.3f} m {RULER_MM} {y:.3f} l S"]
    for mm in range(RULER_MM + 1):
        tick = 5.0 if mm % 10 == 0 else 3.5 if mm % 5 == 0 else 2.0
        lines.append(f"{mm} {y:.3f} m {mm} {y + tick:.3f} l S")
        if mm % 50 == 0:
            lines.append(_text(mm + 0.7, y + 8.0, str(mm)))
    return lines


def _text(x: float, y: float, text: str) -> str:
    """Text in axes whose y points down, so that its matrix turns it upright."""
    shown = text.replace("\\", "\\\\").replace("(", "\\(").replace(")", "\\)")
    return f"0 g BT /F1 {CAPTION_MM} Tf 1 0 0 -1 {x:.3f} {y:.3f} Tm ({shown}) Tj ET"


def _file(objects: list[bytes]) -> bytes:
    """The objects, numbered from 1, with the table of their places."""
    body, places = bytearray(b"%PDF-1.4\n"), []
    for number, content in enumerate(objects, start=1):
        places.append(len(body))
        body += b"%d 0 obj\n%s\nendobj\n" % (number, content)
    table = len(body)
    body += b"xref\n0 %d\n0000000000 65535 f \n" % (len(objects) + 1)
    body += b"".join(b"%010d 00000 n \n" % place for place in places)
    body += b"trailer\n<< /Size %d /Root 1 0 R >>\nstartxref\n%d\n%%%%EOF\n" % (len(objects) + 1, table)
    return bytes(body)
