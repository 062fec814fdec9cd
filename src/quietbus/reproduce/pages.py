"""The table and the report as Markdown."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE_HEAD
from rich.table import Table as RichTable

from quietbus.reproduce.claims import ORIGINS, RULES

if TYPE_CHECKING:
    from quietbus.reproduce.paper import Made


def table_page(table: Mapping[str, Any]) -> str:
    """``table.md``."""
    return f"# {table['reference']}\n\n{_table(table)}"


def report_page(
    table: Mapping[str, Any], chapters: Mapping[str, Sequence[tuple[str, "Made | None", str]]]
) -> str:
    """``report.md``: all figures with captions, the table, and what the paper misses.

    Args:
        table: the content of ``table.json``.
        chapters: by heading, title, what was made (or None) and name of each part.
    """
    reasons = {failure["name"]: failure["reason"] for failure in table["failed"]}
    parts = [
        f"# Reproduction of {table['paper']}\n\n{table['reference']}\n\n"
        f"Made by `quietbus reproduce {table['paper']}`, version {table['quietbus_version']}; "
        f"every number and picture is computed.\n\n{counts(table['rows'])}"
    ]
    for heading, items in chapters.items():
        parts.append(f"## {heading}\n")
        for title, made, name in items:
            parts.append(f"### {title}\n")
            if made is None:
                parts.append(f"Not made: {reasons.get(name, 'interrupted before it')}\n")
                continue
            if made.text:
                parts.append(made.text.strip() + "\n")
            parts.append(f"![{title}]({made.file})\n\n{made.caption}\n")
    parts.append(f"## All published numbers\n\n{_table(table)}")
    return "\n".join(parts)


def counts(rows: Sequence[Mapping[str, Any]]) -> str:
    """How many numbers met which verdict, by where ours come from; each number once."""
    once = [row for row in rows if row["repeats"] is None]
    verdicts = [verdict for verdict in RULES if any(row["verdict"] == verdict for row in once)]
    lines = [
        f"The table at the end has {len(rows)} rows. {len(rows) - len(once)} of them are another "
        f"row's number once more, by symmetry or rule; the other {len(once)} are, by where ours "
        f"come from:",
        "",
        "| ours are | " + " | ".join(verdicts) + " | together |",
        "|---" * (len(verdicts) + 2) + "|",
    ]
    for origin in ORIGINS:
        own = Counter(row["verdict"] for row in once if row["origin"] == origin)
        counted = [str(own[verdict]) for verdict in verdicts]
        lines.append(f"| {origin} | " + " | ".join([*counted, str(own.total())]) + " |")
    return "\n".join(lines) + "\n"


def _table(table: Mapping[str, Any]) -> str:
    lines = ["| verdict | rule |", "|---|---|"]
    lines += [f"| {verdict} | {rule} |" for verdict, rule in RULES.items()]
    lines += ["", "| ours are | that is |", "|---|---|"]
    lines += [f"| {origin} | {meaning} |" for origin, meaning in ORIGINS.items()]
    lines += [
        "",
        "| where | what | published | ours | difference | ours are | verdict | why |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in table["rows"]:
        ours = "-" if row["ours"] is None else f"{row['ours']:.4g} {row['unit']}".strip()
        relative = row["relative_difference"]
        difference = "-" if relative is None else f"{100 * relative:+.2g} %"
        printed = f"{row['printed']} {row['unit']}".strip()
        origin = row["origin"] + (" (repeated)" if row["repeats"] else "")
        cells = (row["place"], row["quantity"], printed, ours, difference, origin, row["verdict"])
        lines.append("| " + " | ".join((*cells, row["why"])).replace("\n", " ") + " |")
    if table["failed"]:
        lines += ["", "Failed:", ""]
        lines += [f"- {failure['name']}: {failure['reason']}" for failure in table["failed"]]
    return "\n".join(lines) + "\n"


def verdicts_table(table: Mapping[str, Any]) -> RichTable:
    """What was published, what we get and the verdict, for the terminal."""
    shown = RichTable(title=f"Published numbers of {table['paper']}", box=SIMPLE_HEAD)
    for column in ("where", "what", "published", "ours", "ours are", "verdict"):
        shown.add_column(column, justify="right" if column in ("published", "ours") else "left")
    for row in table["rows"]:
        ours = "-" if row["ours"] is None else f"{row['ours']:.4g}"
        printed = f"{row['printed']} {row['unit']}".strip()
        shown.add_row(row["place"], row["quantity"], printed, ours, row["origin"], row["verdict"])
    return shown
