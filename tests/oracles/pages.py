"""What the documentation shows, against what comes out: tables, and output of its code."""

import re

NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"


def table(text: str, heading: tuple[str, ...]) -> list[list[str]]:
    """Rows of all tables in a page that have the given heading."""
    found, inside = [], False
    for line in text.splitlines():
        if not line.startswith("|"):
            inside = False
            continue
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if tuple(cells) == heading:
            inside = True
        elif inside and set(line) - set("|- "):
            assert len(cells) == len(heading), line
            found.append(cells)
    assert found, f"no table {heading}"
    return found


def assert_rounds(shown: str, *real: float) -> None:
    """The numbers of a text, thousands parted by spaces, are these to the last digit shown."""
    text = re.sub(r"(?<=\d) (?=\d{3}\b)", "", shown.replace("−", "-"))
    numbers = re.findall(NUMBER, text)
    assert len(numbers) == len(real), shown
    for number, value in zip(numbers, real, strict=True):
        mantissa, _, exponent = number.partition("e")
        unit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
        assert abs(float(number) - value) <= 0.501 * unit, f"{shown}: {value}"


def assert_says(page: str, said: str, *real: float) -> None:
    """A page has this sentence, with these numbers for its ``#``, to the last digit shown.

    Args:
        page: Markdown; powers of ten may be written in TeX.
    """
    text = " ".join(page.split()).replace(r"\cdot", "").replace(" 10^{", " 1 10^{")
    text = re.sub(r"(\d)\s*10\^\{(-?\d+)\}", r"\1e\2", text.replace("$10^{", "$1 10^{"))
    pattern = re.escape(" ".join(said.split())).replace(r"\#", rf"({NUMBER})")
    found = re.search(pattern, text)
    assert found, f"the page does not say: {said}"
    for shown, value in zip(found.groups(), real, strict=True):
        assert_rounds(shown, value)


def assert_shown(shown: str, output: str) -> None:
    """Every line of ``shown`` comes in ``output``, in order; others may come in between.

    ``...`` stands for anything, a number that is not whole may differ by one in its last digit.
    """
    left = iter(output.splitlines())
    for line in filter(None, (" ".join(line.split()) for line in shown.splitlines())):
        assert any(_same(line, " ".join(real.split())) for real in left), (
            f"not in the output, or not in this place: {line}\n{output}"
        )


def _same(shown: str, real: str) -> bool:
    parts = re.split(rf"(\.\.\.|{NUMBER})", shown)
    pattern = "".join(
        (".*?" if part == "..." else f"({NUMBER})") if i % 2 else re.escape(part)
        for i, part in enumerate(parts)
    )
    found = re.fullmatch(pattern, real)
    numbers = [part for part in parts[1::2] if part != "..."]
    return bool(found) and all(map(_close, numbers, found.groups()))


def _close(shown: str, real: str) -> bool:
    """Equal, but for one in the last digit of a number that is not whole."""
    mantissa, _, exponent = shown.partition("e")
    decimals = len(mantissa.partition(".")[2])
    unit = 10.0 ** (int(exponent or 0) - decimals) if decimals or exponent else 0.0
    return abs(float(shown) - float(real)) <= 1.001 * unit
