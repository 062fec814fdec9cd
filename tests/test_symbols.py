"""The symbols of docs/theory.md: each is in the table of docs/notation.md, in one row."""

import re
from collections import Counter
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
FORMULA = re.compile(r"\$([^$]+)\$")
FENCE = re.compile(r"^```.*?^```$", re.DOTALL | re.MULTILINE)
TRANSPOSED = re.compile(r"\^(?:[TH](?![a-z])|\{(?:-|\\!)?[TH]\})")
WORDS = re.compile(r"\\(?:tag|text|mathrm|begin|end)\s*\{[^{}]*\}|\\q?quad\b")
TOKEN = re.compile(r"\\[A-Za-z]+|(?<=_\{)[a-z]{3,}|\\.|[A-Za-z]|\d+|\S", re.DOTALL)
GREEK = re.compile(
    r"\\(alpha|beta|gamma|delta|(var)?epsilon|zeta|eta|(var)?theta|kappa|lambda|mu|nu|xi|rho|"
    r"sigma|tau|(var)?phi|chi|psi|omega|Gamma|Omega|Phi|Pi|Sigma|ell|Pr)"
)
FONTS = {"\\hat", "\\bar", "\\mathbf", "\\mathcal"}  # part of the symbol; dot and ring are rates
INDICES = {"i", "j", "k", "m", "n"}  # numbers of things: no part of the symbol
DIFFERENTIALS = {"m", "f", "t", "x", "\\gamma", "\\varphi", "\\vartheta"}


def symbols(tex: str) -> set[str]:
    """Symbols of a formula: font, letter and label, without rates, powers and running indices."""
    tokens = TOKEN.findall(TRANSPOSED.sub(" ", WORDS.sub(" ", tex)))
    found, at = set(), 0
    while at < len(tokens):
        token, at = tokens[at], at + 1
        if token == "_":  # of a sum, a maximum, a bracket
            at = _after(tokens, at)
        font = token[1:] + " " if token in FONTS else ""
        if font:
            at += tokens[at] == "{"
            token, at = tokens[at], at + 1
        if not (token.isalpha() or GREEK.fullmatch(token)):
            continue
        after = tokens[at] if at < len(tokens) else ""
        if token == "d" and after in DIFFERENTIALS:
            at += 1
            continue
        if token == "e" and after == "^":
            continue
        label = []
        if after == "_":
            end = _after(tokens, at + 1)
            label = [part for part in tokens[at + 1 : end] if part not in "{},_"]
            at = end
        label = [part for part in label if part not in INDICES and part != "\\dot"]
        label = [part for part in label if not part.isdigit() or label == [part]]
        found.add(font + token + ("_" + "".join(label) if label else ""))
    return found


def _after(tokens: list[str], at: int) -> int:
    """The place after the group that begins there, or after the one token."""
    depth = 0
    while True:
        depth += (tokens[at] == "{") - (tokens[at] == "}")
        at += 1
        if depth == 0:
            return at


def _sections() -> dict[str, set[str]]:
    """The symbols of each section's formulas, displayed or within the text."""
    text = FENCE.sub("", (DOCS / "theory.md").read_text(encoding="utf-8")).replace("$$", "$")
    parts = re.split(r"^## (\d+) .*$", text, flags=re.MULTILINE)
    formulas = map(FORMULA.findall, parts[2::2])
    return {n: symbols(" ".join(each)) for n, each in zip(parts[1::2], formulas, strict=True)}


def _table() -> list[tuple[set[str], list[str]]]:
    page = (DOCS / "notation.md").read_text(encoding="utf-8")
    rows = page.split("## Symbols of the theory")[1].split("\n## ")[0].splitlines()
    cells = [row.strip("|").split(" | ") for row in rows if row.startswith("| $")]
    return [(symbols(row[0]), row[-1].strip(" |").split(", ")) for row in cells]


SECTIONS, TABLE = _sections(), _table()


@pytest.mark.parametrize("section", SECTIONS)
def test_every_symbol_is_in_the_table(section):
    known = set().union(*(row for row, _ in TABLE))
    left = SECTIONS[section] - known - INDICES
    assert left == set(), f"in section {section}, not in docs/notation.md: {sorted(left)}"


def test_no_symbol_is_in_two_rows():
    count = Counter(symbol for row, _ in TABLE for symbol in row)
    assert {symbol for symbol, rows in count.items() if rows > 1} == set()


def test_every_symbol_of_the_table_is_used_where_it_says():
    for row, sections in TABLE:
        left = row.difference(*(SECTIONS[section] for section in sections))
        assert left == set(), f"not in section {sections}: {sorted(left)}"


@pytest.mark.parametrize(
    ("tex", "found"),
    [
        (r"\dot H_l = I_{lt}\,s_l\times\ddot s_l", {"H_l", "I_lt", "s_l"}),
        (r"\hat Q_h e^{ih\varphi}\,dm", {"hat Q_h", "i", "h", r"\varphi"}),
        (r"h_{s,1}\hat t_1 + \text{word}\, A^T \mathring{\mathring Q}_{mn}",
         {"h_s", "hat t_1", "A", "Q"}),
        (r"M_{c,ii}\begin{pmatrix}v_P\\ \omega_P\end{pmatrix}^{\!T} \tag{3}",
         {"M_c", "v_P", r"\omega_P"}),
    ],
)  # fmt: skip
def test_symbols_of_a_formula(tex, found):
    assert symbols(tex) == found
