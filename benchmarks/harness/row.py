"""One line of a benchmark: a figure, and what it is measured against."""

from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class Row:
    """A measured figure; a lower `ratio` is better where `value` is a cost."""

    name: str
    value: float
    unit: str
    against: str
    """What it is compared with: a limit, another form of the same computation, another program."""
    against_value: float
    """In the same unit."""

    @property
    def ratio(self) -> float:
        """value / against_value; NaN where there is nothing to divide by."""
        return self.value / self.against_value if self.against_value else float("nan")

    def as_dict(self) -> dict[str, str | float]:
        """The row as `vpltune bench --json` prints it."""
        return asdict(self) | {"ratio": self.ratio}
