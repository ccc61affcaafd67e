"""One line of a benchmark's output: a figure and what it is compared with."""

from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class Row:
    """A measured figure. Where `value` is a cost, a lower `ratio` is better."""

    name: str
    value: float
    unit: str
    against: str
    """What the figure is compared with: a limit, another way to compute the same, or another program."""
    against_value: float
    """The value of `against`, in `unit`."""

    @property
    def ratio(self) -> float:
        """`value` / `against_value`; NaN where `against_value` is 0."""
        return self.value / self.against_value if self.against_value else float("nan")

    def as_dict(self) -> dict[str, str | float]:
        """The row as `vpltune bench --json` prints it."""
        return asdict(self) | {"ratio": self.ratio}
