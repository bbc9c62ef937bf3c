"""Keys and values of a calibration file: YAML, JSON, OpenCV's dialect of both, and mrcal's. Nothing is executed."""

from __future__ import annotations

import ast
import re
from typing import Any, Final

from fwav_companion.errors import InputFileError

LONGEST_FILE_CHARACTERS: Final = 1_000_000
"""A camchain of eight cameras has 6000."""
OCAMCALIB: Final = "DIRECT mapping function"
"""Heading of an OCamCalib file, which has neither keys nor another mark."""
OCAMCALIB_TABLES: Final = ("polynomial", "inverse", "center", "affine", "size")
"""Its tables in their order."""
STAMP_KEYS: Final = ("header", "seq", "stamp")
"""Keys that differ between recorded messages of one camera."""
MOST_ALIASES: Final = 32
"""Most YAML aliases. Calibration tools write none to a few; of so many, the worst nesting expands to 130 000 values."""


def document(text: str, name: str, accepted: str) -> dict[str, Any]:
    """The one mapping in a file. InputFileError without one, or with several that differ."""
    if len(text) > LONGEST_FILE_CHARACTERS:
        raise InputFileError(f"{name}: {len(text)} characters; {accepted}")
    if OCAMCALIB in text:
        tables = _ocamcalib_tables(text)
        if not tables:
            raise InputFileError(f"{name}: not a whole calib_results.txt of OCamCalib; {accepted}")
        return tables
    mappings = [_python_mapping(text, name, accepted)] if _is_mrcal(text) else _yaml_mappings(text, name, accepted)
    if not mappings:
        raise InputFileError(f"{name}: no keys and values in it; {accepted}")
    if _differ(mappings):
        raise InputFileError(
            f"{name}: {len(mappings)} documents, separated by ---, of different cameras; accepted: the one that flies"
        )
    return mappings[0]


def _ocamcalib_tables(text: str) -> dict[str, Any]:
    """The tables of an OCamCalib file, named by comments alone; {} where some are missing."""
    lines = [line.split() for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    try:
        tables = [[float(word) for word in line] for line in lines]
    except ValueError:
        return {}
    return (
        {"ocamcalib": dict(zip(OCAMCALIB_TABLES, tables, strict=True))} if len(tables) == len(OCAMCALIB_TABLES) else {}
    )


def _is_mrcal(text: str) -> bool:
    return re.search(r"""^\s*\{?\s*['"]lensmodel['"]\s*:""", text, re.MULTILINE) is not None


def _python_mapping(text: str, name: str, accepted: str) -> dict[str, Any]:
    """A Python literal, as mrcal writes it: its encoded inputs are bytes, which YAML has no word for."""
    try:
        found = ast.literal_eval(text.strip())
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError):
        found = None
    if not isinstance(found, dict) or not all(isinstance(key, str) for key in found):
        raise InputFileError(f"{name}: not a whole .cameramodel of mrcal; {accepted}")
    return found


def _yaml_mappings(text: str, name: str, accepted: str) -> list[dict[str, Any]]:
    import yaml  # here: a relay without a camera never needs it

    class Loader(yaml.SafeLoader):
        """A safe loader that reads OpenCV's matrices, mappings with a tag, and bounds what aliases expand to."""

        aliases = 0

        def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
            """The next node, which may be an alias of an earlier one."""
            self.aliases += self.check_event(yaml.AliasEvent)
            if self.aliases > MOST_ALIASES:
                raise yaml.YAMLError(f"more than {MOST_ALIASES} aliases")
            node: yaml.Node | None = super().compose_node(parent, index)
            return node

    def plain_mapping(loader: Loader, node: yaml.MappingNode) -> dict[Any, Any]:
        return loader.construct_mapping(node, deep=True)

    for tag in ("opencv-matrix", "opencv-nd-matrix"):
        Loader.add_constructor(f"tag:yaml.org,2002:{tag}", plain_mapping)
    if text.startswith("%YAML"):  # OpenCV spells the directive in a way that YAML does not accept
        text = text.partition("\n")[2]
    try:
        documents = list(yaml.load_all(text, Loader=Loader))
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InputFileError(f"{name}: {' '.join(str(error).split())[:200]}; {accepted}") from error
    except (LookupError, AttributeError, TypeError, ArithmeticError) as error:  # what PyYAML raises then
        raise InputFileError(f"{name}: a value contradicts its YAML tag (!!); {accepted}") from error
    mappings = [each for each in documents if each is not None]
    if not all(isinstance(each, dict) and all(isinstance(key, str) for key in each) for each in mappings):
        raise InputFileError(f"{name}: no keys and values in it; {accepted}")
    return mappings


def _differ(mappings: list[dict[str, Any]]) -> bool:
    """Whether the mappings are of different cameras; so are those that contain themselves, which have no end."""
    first = _without_stamps(mappings[0])
    try:
        return any(_without_stamps(other) != first for other in mappings[1:])
    except RecursionError:
        return True


def _without_stamps(mapping: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in mapping.items() if key not in STAMP_KEYS}
