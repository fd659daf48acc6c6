"""Facts as pieces of a page: the verdict with its figures, folded notes, tables and lists, with links to moments."""

import base64
from collections.abc import Sequence
from html import escape

from maniport.telling.answer import Answer, Card, rounded_sum
from maniport.telling.facts import INFO, MOMENT, NOTE, Fact, Facts, Section, Table
from maniport.telling.page.content import Picture

HEADINGS = 3
"""A page with as many sections has a menu."""


def header(facts: Facts, places: Sequence[tuple[str, str]]) -> str:
    """Write the head of a page: title, lead, menu of `places` (title, id), and the verdict, or warnings without one."""
    menu = " ".join(f'<a href="#{place}">{escape(title)}</a>' for title, place in places)
    lines = [
        f"<h1>{escape(facts.title)}</h1>",
        f'<p class="lead">{escape(facts.lead)}</p>' if facts.lead else "",
        f'<nav aria-label="Sections">{menu}</nav>' if len(places) >= HEADINGS else "",
        warnings(facts) if facts.verdict is None else verdict(facts.verdict),
    ]
    return "\n".join(["<header>", *filter(None, lines), "</header>"])


def verdict(answer: Answer) -> str:
    """Write the verdict and its cards."""
    command = f" <code>{escape(answer.typed())}</code>" if answer.command else ""
    advice = f'<p class="advice">{linked(answer.advice)}{command}</p>' if answer.advice else ""
    text = "".join(f"<p>{linked(one)}</p>" for one in (answer.status_text, answer.text, answer.doubts) if one)
    kind = f"verdict {answer.status}".strip()
    cards = "\n".join(map(_card, answer.cards))
    return (
        f'<section class="{kind}" aria-label="Verdict">\n<h2>{linked(answer.title)}</h2>\n{text}\n{advice}\n</section>'
        f'\n<div class="cards">\n{cards}\n</div>'
    )


def _card(card: Card) -> str:
    details = "".join(
        f'<span class="{"alarm" if detail == card.alarm else "detail"}">{linked(detail)}</span> '
        for detail in card.details
    )
    about = f" <small>{escape(card.about)}</small>" if card.about else ""
    return (
        f'<div class="card"><h3>{escape(card.name)}</h3><p class="value">{escape(card.value)}{about}</p>'
        f"{_parts(card)}<p>{details}</p></div>"
    )


def _parts(card: Card) -> str:
    """Draw parts as a bar; attributes instead of styles, which the page's policy forbids."""
    total = sum(max(part, 0.0) for _, part in card.parts)
    if total <= 0.0:
        return ""
    bars, keys, start = [], [], 0.0
    mean, printed = rounded_sum([part for _, part in card.parts])
    for k, (words, part) in enumerate(card.parts):
        width = 100.0 * max(part, 0.0) / total
        bars.append(f'<rect class="part{k}" x="{start:.2f}" width="{width:.2f}" height="8"/>')
        keys.append(f'<li><i class="part{k}"></i>{printed[k]} {escape(words)}</li>')
        start += width
    words = f"mean {mean}"
    svg = f'<svg class="bar" viewBox="0 0 100 8" preserveAspectRatio="none" aria-hidden="true">{"".join(bars)}</svg>'
    return f'{svg}<ul class="parts" aria-label="{words}"><li>{words} =</li>{"".join(keys)}</ul>'


def warnings(facts: Facts, folded: bool = False) -> str:
    """Write all warnings, and folded the notes as well, which else stand in their sections."""
    texts = [*facts.warnings, *(facts.notes if folded else ())]
    if not texts:
        return ""
    items = "\n".join(f"<li>{linked(text)}</li>" for text in texts)
    if folded:
        counts = [(len(facts.warnings), "warning"), (len(facts.notes), "note")]
        count = " and ".join(f"{n} {word}{'s' if n > 1 else ''}" for n, word in counts if n)
        shown = " open" if facts.warnings else ""
        return f'<details class="mind"{shown}><summary>{count}</summary>\n<ul>\n{items}\n</ul>\n</details>'
    return f'<section class="mind" aria-label="Warnings">\n<h2>Warnings</h2>\n<ul>\n{items}\n</ul>\n</section>'


def section(part: Section, place: str, shown: str, below: str = "") -> str:
    """Write a section: what is `shown` of it first, then its tables and figures, then what stands `below`."""
    lines = [f"<p>{escape(paragraph)}</p>" for paragraph in part.text.split("\n") if paragraph]
    titles = [f"{part.title}: table {k + 1}" for k in range(len(part.tables))]
    lines += [shown, *map(_table, part.tables, titles), _facts(part.facts), below]
    inner = "\n".join(filter(None, lines))
    if part.folded:
        summary = f"<summary><h3>{escape(part.title)}</h3></summary>"
        return f'<details class="folded" id="{place}">{summary}\n{inner}\n</details>'
    title = f"<h2>{escape(part.title)}</h2>" if part.title else ""
    return f'<section id="{place}">\n{title}\n{inner}\n</section>'


def linked(text: str) -> str:
    """Write a text whose moments are links to them."""
    return MOMENT.sub(r'<a href="#t=\1">\g<0></a>', escape(text))


def _table(table: Table, title: str) -> str:
    caption = f'<p class="meaning">{escape(table.caption)}</p>' if table.caption else ""
    head = "".join(f'<th scope="col">{escape(name)}</th>' if name else "<td></td>" for name in table.columns)
    rows = "\n".join("<tr>" + "".join(f"<td>{linked(cell)}</td>" for cell in row) + "</tr>" for row in table.rows)
    table_of = f"<table><thead><tr>{head}</tr></thead>\n<tbody>{rows}</tbody></table>"
    return f'{caption}<div class="scroll" tabindex="0" role="region" aria-label="{escape(title)}">{table_of}</div>'


def _facts(facts: tuple[Fact, ...]) -> str:
    """Write figures as a list of names and values, notes as sentences; warnings stand at the head of the page."""
    told = [fact for fact in facts if fact.text and fact.severity == INFO]
    entries = []
    for fact in told:
        meaning = f' <span class="meaning">{escape(fact.meaning)}</span>' if fact.meaning else ""
        entries.append(f"<dt>{escape(fact.name)}</dt><dd><b>{linked(fact.text)}</b>{meaning}</dd>")
    notes = [f"<p>{linked(fact.text)}</p>" for fact in facts if fact.text and fact.severity == NOTE]
    return "\n".join([*notes, *(["<dl>\n" + "\n".join(entries) + "\n</dl>"] if entries else [])])


def picture(one: Picture) -> str:
    """Write a picture."""
    data = base64.b64encode(one.png).decode("ascii")
    return f'<img alt="{escape(one.description)}" src="data:image/png;base64,{data}">'
