"""The answer of a comparison of settings over recorded flights: text and page. PURE."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import Final

from fwav_companion.tools.report.page_elements import document, row, section, table
from fwav_companion.tools.report.wording import table_length
from fwav_companion.tools.study.paired_settings import MeasureComparison
from fwav_companion.tools.study.setting_record import Measure, SettingRecord

MOST_NAMED: Final = 10
"""Most flights that are named for one measure and setting."""
HEADS: Final = ("setting", "flights", "as recorded", "with the setting", "paired change", "95 % interval",
                "better / worse", "p (Holm)", "verdict")  # fmt: skip


def setting_names(settings: Sequence[Sequence[str]]) -> list[str]:
    """Names of the settings by their numbers; 0 is the recorded one."""
    return ["as recorded", *(" ".join(each) for each in settings)]


def sentence(comparisons: Sequence[MeasureComparison], names: Sequence[str], flights: int) -> str:
    """The answer by the first measure that flights have."""
    if not comparisons:
        return f"None of the {flights} flights could be compared."
    first = comparisons[0].measure
    parts = []
    for each in (each for each in comparisons if each.measure == first):
        change = f"paired median {signed_value(each.change, first)}"
        parts.append(f"{names[each.setting]}: {each.verdict} ({change}, {each.better} better, {each.worse} worse)")
    return f"By {first.name}, over {comparisons[0].pairs} paired flights: {'; '.join(parts)}."


def lines(comparisons: Sequence[MeasureComparison], names: Sequence[str]) -> Iterator[str]:
    """A table for each measure."""
    for measure in dict.fromkeys(each.measure for each in comparisons):
        yield f"{measure.name}"
        for each in (each for each in comparisons if each.measure == measure):
            cells = cells_of(each, names)
            setting, _, before, after, change, between, _, p, verdict = cells
            counts = f"{each.better} better, {each.worse} worse"
            yield f"  {setting}: {before} -> {after}, change {change} ({between}), {counts}, p {p}: {verdict}"
            for flight in each.got_worse[:MOST_NAMED]:
                yield f"    worse: {flight.flight}: {shown(flight.before, measure)} -> {shown(flight.after, measure)}"
            if len(each.got_worse) > MOST_NAMED:
                yield f"    and {len(each.got_worse) - MOST_NAMED} more"


def cells_of(each: MeasureComparison, names: Sequence[str]) -> list[str]:
    """The cells of one comparison, in the order of HEADS."""
    between = "too few flights"
    if each.interval is not None:
        low, high = (signed_value(end, each.measure) for end in each.interval)
        between = f"{low} to {high}"
    return [
        names[each.setting],
        f"{each.pairs}",
        shown(each.before, each.measure),
        shown(each.after, each.measure),
        signed_value(each.change, each.measure),
        between,
        f"{each.better} / {each.worse}",
        f"{each.p_holm:.2g}",
        each.verdict,
    ]


def settings_page(
    comparisons: Sequence[MeasureComparison],
    names: Sequence[str],
    records: Sequence[SettingRecord],
    where: str,
    *,
    version: str,
) -> str:
    """The HTML file."""
    flights = len({record.flight for record in records})
    head = (
        f'<header><p class="kicker">fwav-companion study</p><h1>Would other settings have been better</h1>'
        f'<p class="lead also">{escape(sentence(comparisons, names, flights))}</p></header>'
    )
    sections = [head]
    for measure in dict.fromkeys(each.measure for each in comparisons):
        rows = [each for each in comparisons if each.measure == measure]
        body = [row(cells_of(each, names), _colour(each)) for each in rows]
        worse = [
            row([names[each.setting], flight.flight, shown(flight.before, measure), shown(flight.after, measure)])
            for each in rows
            for flight in each.got_worse[:MOST_NAMED]
        ]
        more = table(["setting", "got worse", "as recorded", "with the setting"], worse) if worse else ""
        title = f"{measure.name[0].upper()}{measure.name[1:]}"
        sections.append(section(title, "", f'<div class="wrapped">{table(HEADS, body)}{more}</div>'))
    damaged = {record.flight: record.damage for record in records if record.damage}
    if damaged:
        body = [row([flight, why]) for flight, why in damaged.items()]
        sections.append(section("Left out", "", table(["flight", "reason"], body)))
    words = (
        f"Every flight in {where} was replayed as recorded and under each setting, and compared with itself. The sign "
        "test asks whether more flights got better than worse; p is corrected for the number of settings (Holm)."
    )
    sections.append(section("How this was computed", words, f"<footer><p>fwav-companion {version}.</p></footer>"))
    return document("Would other settings have been better", sections)


def shown(value: float, measure: Measure) -> str:
    """A value with its unit."""
    if measure.unit == "m":
        return table_length(value)
    return f"{100.0 * value:.1f} %" if measure.unit == "%" else f"{value:.2f}"


def signed_value(value: float, measure: Measure) -> str:
    """A change with its sign."""
    return f"{'+' if value > 0.0 else '-' if value < 0.0 else ''}{shown(abs(value), measure)}"


def _colour(each: MeasureComparison) -> str:
    return {"better": "good", "worse": "off"}.get(each.verdict, "")
