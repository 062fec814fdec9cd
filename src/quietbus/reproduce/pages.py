"""The table and the report as Markdown."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE_HEAD
from rich.table import Table as RichTable

from quietbus.reproduce.claims import RULES

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
    counts = Counter(row["verdict"] for row in table["rows"])
    counted = ", ".join(f"{counts[verdict]} {verdict}" for verdict in RULES if counts[verdict])
    parts = [
        f"# Reproduction of {table['paper']}\n\n{table['reference']}\n\n"
        f"Made by `quietbus reproduce {table['paper']}`, version {table['quietbus_version']}; "
        f"every number and picture is computed. Published numbers: {len(table['rows'])}, of them "
        f"{counted}.\n"
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


def _table(table: Mapping[str, Any]) -> str:
    lines = ["| verdict | rule |", "|---|---|"]
    lines += [f"| {verdict} | {rule} |" for verdict, rule in RULES.items()]
    lines += [
        "",
        "| where | what | published | ours | difference | verdict | why |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in table["rows"]:
        ours = "-" if row["ours"] is None else f"{row['ours']:.4g} {row['unit']}".strip()
        relative = row["relative_difference"]
        difference = "-" if relative is None else f"{100 * relative:+.2g} %"
        printed = f"{row['printed']} {row['unit']}".strip()
        cells = (row["place"], row["quantity"], printed, ours, difference, row["verdict"])
        lines.append("| " + " | ".join((*cells, row["why"])).replace("\n", " ") + " |")
    if table["failed"]:
        lines += ["", "Failed:", ""]
        lines += [f"- {failure['name']}: {failure['reason']}" for failure in table["failed"]]
    return "\n".join(lines) + "\n"


def verdicts_table(table: Mapping[str, Any]) -> RichTable:
    """What was published, what we get and the verdict, for the terminal."""
    shown = RichTable(title=f"Published numbers of {table['paper']}", box=SIMPLE_HEAD)
    for column in ("where", "what", "published", "ours", "verdict"):
        shown.add_column(column, justify="right" if column in ("published", "ours") else "left")
    for row in table["rows"]:
        ours = "-" if row["ours"] is None else f"{row['ours']:.4g}"
        printed = f"{row['printed']} {row['unit']}".strip()
        shown.add_row(row["place"], row["quantity"], printed, ours, row["verdict"])
    return shown
