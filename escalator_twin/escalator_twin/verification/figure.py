"""A figure of the verification: a number beside the bar that it has to meet."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """One line of the verification.

    Attributes
    ----------
    subject : str
        What was held against what.
    name : str
        What the value is.
    value : float
    unit : str
        Empty for a pure number.
    most, least : float or None
        The bar, where there is one.
    """

    subject: str
    name: str
    value: float
    unit: str = ''
    most: float | None = None
    least: float | None = None

    @property
    def holds(self) -> bool:
        """Whether the value meets its bar; a value without a bar does."""
        above = self.least is None or self.value >= self.least
        return above and (self.most is None or self.value <= self.most)

    def line(self) -> str:
        """Return the figure as one line of text."""
        bar = ''
        if self.most is not None:
            bar = f'at most {self.most:g}'
        if self.least is not None:
            bar = f'{bar}, at least {self.least:g}' if bar else f'at least {self.least:g}'
        value = f'{self.value:.4g} {self.unit}'.strip()
        mark = ' ' if not bar else '+' if self.holds else '!'
        return f'{mark} {self.name:<64} {value:>14}   {bar}'.rstrip()
