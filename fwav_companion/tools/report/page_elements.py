"""HTML elements of the page, and its style sheet. Every text from a recording is escaped here. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

KeyEntry = tuple[str, str, str]
"""One line of a legend: (colour class, form, name); forms: line | dot | area | cross."""


def figure(title: str, drawn: str, caption: str = "", *, key: str = "", below: str = "") -> str:
    """A drawing with its title, its legend and its caption."""
    words = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
    return f"<figure><h3>{escape(title)}</h3>{key}{drawn}{words}{below}</figure>"


def key(entries: Iterable[KeyEntry]) -> str:
    """The legend of a drawing."""
    items = "".join(f'<li><i class="k-{form} k-{kind}"></i>{escape(name)}</li>' for kind, form, name in entries)
    return f'<ul class="key">{items}</ul>'


def table(head: Sequence[str], rows: Iterable[str]) -> str:
    """A table; ``rows`` are HTML, ``head`` is text."""
    names = "".join(f"<th>{escape(name)}</th>" for name in head)
    return f'<div class="scroll"><table><tr>{names}</tr>{"".join(rows)}</table></div>'


def row(cells: Sequence[str], kind: str = "", at: int = -1) -> str:
    """A row of text cells; the class ``kind`` colours the cell with index ``at``."""
    items = [f"<td>{escape(cell)}</td>" for cell in cells]
    if kind:
        items[at] = items[at].replace("<td>", f'<td class="{kind}">', 1)
    return f"<tr>{''.join(items)}</tr>"


def section(title: str, words: str, inside: str) -> str:
    """A heading, a paragraph of text, and the HTML ``inside``."""
    paragraph = f"<p>{escape(words)}</p>" if words else ""
    return f"<section><h2>{escape(title)}</h2>{paragraph}{inside}</section>"


def document(title: str, sections: Iterable[str]) -> str:
    """The complete HTML file of these sections; empty sections are left out."""
    body = "\n".join(each for each in sections if each).replace("95 %", "95\u00a0%")  # no line break in between
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title><style>{STYLE}</style></head>
<body><main>
{body}
</main></body></html>
"""


STYLE = """
:root{--paper:#fbfbf9;--card:#fff;--ink:#1b1f24;--soft:#5b6570;--line:#e3e5e1;--ours:#1f6feb;--other:#d9730d;
--truth:#111;--claim:#1f6feb22;--fix:#7d8790;--good:#197a3e;--path:#9aa5b1;--bound:#9aa5b1;--plain:#8250df;--inset:#f0f1ee}
@media (prefers-color-scheme:dark){:root{--paper:#12151a;--card:#191d24;--ink:#e7eaee;--soft:#9aa4af;--line:#2b313a;
--ours:#6aa5ff;--other:#ffa657;--truth:#fff;--claim:#6aa5ff2b;--fix:#75808c;--good:#5fd08a;--path:#596675;
--bound:#75808c;--plain:#c297ff;
--inset:#0c0e12}}
*{box-sizing:border-box}
body{margin:0;background:var(--paper);color:var(--ink);font:16px/1.55 system-ui,-apple-system,"Segoe UI",Inter,Roboto,
"Helvetica Neue",Arial,sans-serif;-webkit-text-size-adjust:100%}
main{max-width:1120px;margin:0 auto;padding:40px 24px 64px}
header{margin-bottom:28px}
.kicker{margin:0;color:var(--ours);font-weight:600;letter-spacing:.04em}
h1{margin:.1em 0 .3em;font-size:clamp(28px,4.4vw,42px);line-height:1.15;letter-spacing:-.02em}
h2{margin:0 0 10px;font-size:21px;letter-spacing:-.01em}
h3{margin:0 0 6px;font-size:17px;letter-spacing:-.01em}
p{margin:0 0 12px;max-width:72ch}
.lead{font-size:18px;color:var(--soft)}.also{color:var(--ink)}
.chapter{margin-top:44px;padding:26px 26px 28px;border-radius:18px;background:var(--inset)}
section{margin-top:40px}.chapter section:first-child{margin-top:0}section>.scroll:first-child{margin-top:-16px}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(150px,1fr));gap:12px;margin-top:0}
.cards div{background:var(--card);border:1px solid var(--line);border-radius:12px;padding:14px 16px}
.cards b{display:block;font-size:27px;line-height:1.2;letter-spacing:-.02em;font-variant-numeric:tabular-nums}
.cards span{color:var(--soft);font-size:14px}
.two{display:grid;grid-template-columns:1fr 1fr;gap:28px}
.two>*,.one>*,.grid>*{min-width:0}
.broad{grid-template-columns:1.5fr 1fr;align-items:start}.two+.two{margin-top:16px}
.grid{display:grid;grid-template-columns:repeat(auto-fill,minmax(300px,1fr));gap:16px}
.grid.pairs{grid-template-columns:1fr 1fr}
.grid.four{grid-template-columns:repeat(4,1fr)}
@media (max-width:960px){.grid.four{grid-template-columns:1fr 1fr}}
figure{margin:0}
.grid figure,.two figure,.one figure{background:var(--card);border:1px solid var(--line);border-radius:12px;
padding:16px}
figcaption{color:var(--soft);font-size:14px;margin-top:10px}
svg{display:block;width:100%;height:auto;font:12px system-ui,-apple-system,"Segoe UI",Inter,Roboto,Arial,sans-serif}
svg .grid{stroke:var(--line);stroke-width:1}.axis{stroke:var(--soft);stroke-width:1}
.tick{fill:var(--soft);font-size:11px}.name{fill:var(--soft);font-size:11px}
.path{fill:none;stroke:var(--path);stroke-width:1.6;stroke-linejoin:round}.path-start{fill:var(--path)}
.fix{fill:var(--fix);opacity:.55}.east{fill:var(--plain);opacity:.45}.estimate{fill:var(--ours);stroke:var(--card);stroke-width:1.2}
.relative{fill:var(--card);stroke:var(--ours);stroke-width:1.6}
.landmark{fill:none;stroke:var(--good);stroke-width:2.2}
.ellipse{fill:var(--claim);stroke:var(--ours);stroke-width:1.3}.truth{stroke:var(--truth);stroke-width:2}
.label{fill:var(--ink);font-size:13px;font-weight:600;paint-order:stroke;stroke:var(--card);stroke-width:3px;
stroke-linejoin:round}
.bar{stroke:var(--soft);stroke-width:1.4}
.claim{fill:var(--claim);stroke:none}.claim-edge{fill:none;stroke:var(--ours);stroke-width:1;stroke-dasharray:3 3}
.ours{fill:none;stroke:var(--ours);stroke-width:2.2;stroke-linejoin:round}
.variant{fill:none;stroke-width:2.2;stroke-linejoin:round}.claimed{fill:none;stroke-width:1.3;stroke-dasharray:4 4;
opacity:.8}
.variant-paper{stroke:var(--other)}.variant-plain{stroke:var(--plain)}.variant-calibrated{stroke:var(--ours)}
.variant.variant-plain{stroke-width:4;opacity:.65}.variant-own{stroke:var(--good)}
.planted{stroke:var(--truth);stroke-width:1.5;stroke-dasharray:7 4}
.bound{fill:none;stroke:var(--bound);stroke-width:1.4;stroke-dasharray:4 3}
.bar-fill{fill:var(--ours);opacity:.8}
.box{fill:none;stroke:#4da3ff;stroke-width:2.5}.aim{stroke:#ffd166;stroke-width:2}
.box-label{fill:#fff;font-size:19px;font-weight:700;paint-order:stroke;stroke:#0b1a2e;stroke-width:4px}
.two figure svg image{border-radius:6px}
.key,.seen{list-style:none;margin:0 0 10px;padding:0;display:flex;flex-wrap:wrap;gap:4px 18px;font-size:14px;
color:var(--soft)}
.seen{margin:8px 0 0}
.key i{display:inline-block;vertical-align:middle;margin-right:7px}
.k-line{width:20px;height:0;border-top:3px solid}.k-dot{width:9px;height:9px;border-radius:50%}
.k-area{width:18px;height:12px;border-radius:3px;background:var(--claim);border:1.3px solid var(--ours)}
.k-cross{width:13px;height:13px;background:linear-gradient(var(--truth),var(--truth)) center/2px 100% no-repeat,
linear-gradient(var(--truth),var(--truth)) center/100% 2px no-repeat}
.k-path,.k-bound,.k-claimed{border-color:var(--path)}.k-bound,.k-claimed,.k-planted{border-top-style:dashed;
border-top-width:2px}.k-ours,.k-calibrated{border-color:var(--ours)}.k-paper{border-color:var(--other)}
.k-plain{border-color:var(--plain)}.k-own{border-color:var(--good)}.k-planted{border-color:var(--truth)}
.k-dot.k-fix{background:var(--fix)}.k-dot.k-east{background:var(--plain)}.k-dot.k-estimate{background:var(--ours)}
.k-dot.k-landmark{border:2px solid var(--good)}
.k-dot.k-relative{border:2px solid var(--ours)}
table{border-collapse:collapse;width:100%;font-size:15px;font-variant-numeric:tabular-nums}
th{font-weight:600;text-align:right;color:var(--soft);font-size:13px}
td,th{padding:6px 10px 6px 0;border-bottom:1px solid var(--line);text-align:right}
td:first-child,th:first-child{text-align:left}td,.broad th{white-space:nowrap}figure td:first-child{white-space:normal}
.reasons td:last-child{text-align:left;white-space:normal;padding-left:18px;color:var(--soft)}
.reasons th:last-child{text-align:left;padding-left:18px}
.reasons td:nth-child(2){width:70px}
.wrapped td:first-child,.wrapped td:last-child{white-space:normal;overflow-wrap:anywhere}
.good{color:var(--good);font-weight:600}.off{color:var(--other);font-weight:600}
.scroll{overflow-x:auto;margin-top:18px}figure .scroll{margin-top:0}
.bar-row{display:grid;grid-template-columns:minmax(0,1.4fr) minmax(60px,1fr) 64px;gap:12px;align-items:center;
padding:5px 0;font-size:15px}
.bar-row b{text-align:right;font-variant-numeric:tabular-nums;font-weight:600}
.track{background:var(--line);border-radius:4px;height:10px;overflow:hidden}.track i{display:block;height:100%;
background:var(--ours);border-radius:4px}
footer{margin-top:48px;padding-top:16px;border-top:1px solid var(--line);color:var(--soft);font-size:14px}
footer p{max-width:none;overflow-wrap:anywhere}
@media (max-width:760px){main{padding:24px 14px 48px}.two,.broad,.grid.pairs,.grid.four{
grid-template-columns:1fr;gap:18px}
.broad svg .tick,.broad svg .name{font-size:14px}
.lead{font-size:16px}
.cards{grid-template-columns:1fr 1fr}.cards b{font-size:22px}.cards div:last-child:nth-child(odd){grid-column:1/-1}
section{margin-top:30px}.chapter{margin-left:-14px;margin-right:-14px;padding:20px 14px;border-radius:0}
.grid figure,.two figure,.one figure{padding:12px}.bar-row{font-size:14px;gap:8px}}
@media print{body{background:#fff}figure,.cards div{break-inside:avoid}}
"""
"""The style sheet: one column on a phone, two on a desk; system fonts; colours for light and dark."""
