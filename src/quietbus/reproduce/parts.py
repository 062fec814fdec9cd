"""What a reproduced paper consists of."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

if TYPE_CHECKING:
    from quietbus.reproduce.claims import Claim
    from quietbus.reproduce.paper import Workshop


@dataclass(frozen=True)
class Findings:
    """What one part found: a picture and its caption, numbers, and words."""

    figure: Figure
    caption: str
    numbers: Mapping[str, float] = field(default_factory=dict)
    text: str = ""  # Markdown, before the picture


@dataclass(frozen=True)
class Part:
    """One figure with the numbers that come with it."""

    name: str  # of its file
    title: str
    make: Callable[[Any], Findings]  # from the paper's bench
    needs: Mapping[str, str] = field(default_factory=dict)  # modules: the extras they come with


@dataclass(frozen=True)
class Paper:
    """A paper: its published numbers, and the parts that make them again."""

    name: str
    reference: str
    claims: "Sequence[Claim]"
    chapters: Mapping[str, Sequence[Part]]  # by heading
    bench: Callable[["Workshop"], Any]  # what the parts share, computed when first asked for

    @property
    def parts(self) -> list[Part]:
        """All parts in order."""
        return [part for parts in self.chapters.values() for part in parts]
