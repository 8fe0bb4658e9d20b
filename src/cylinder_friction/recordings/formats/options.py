"""What a user may state about a text file; by default everything is detected."""

import codecs
from dataclasses import dataclass

HEADERS = ("auto", "none", "names", "names_units")


@dataclass(frozen=True)
class CsvOptions:
    """How a text file is to be read."""

    delimiter: str = "auto"  # Between two values: one character, ``whitespace`` (runs of blanks and tabs), or ``auto``
    decimal: str = "auto"  # The decimal sign, ``.`` or ``,``, or ``auto``
    encoding: str = "auto"  # Of the characters, for example ``utf-8`` or ``cp1252``, or ``auto``
    # ``none`` (channels are then named column_1, column_2, ...), ``names`` (one line of names), ``names_units`` (a line
    # of names and a line of units), or ``auto``, which also skips what a logger writes above the names
    header: str = "auto"

    def __post_init__(self) -> None:
        if self.delimiter not in ("auto", "whitespace") and (len(self.delimiter) != 1 or self.delimiter in '\r\n"'):
            raise ValueError(f"delimiter: expected one character, 'whitespace' or 'auto', but got {self.delimiter!r}")
        if self.decimal not in ("auto", ".", ","):
            raise ValueError(f"decimal: expected '.', ',' or 'auto', but got {self.decimal!r}")
        if self.header not in HEADERS:
            raise ValueError(f"header: expected one of {', '.join(HEADERS)}, but got {self.header!r}")
        if self.encoding != "auto":
            try:
                codecs.lookup(self.encoding)
            except LookupError:
                expected = "expected one that Python knows, such as utf-8 or cp1252, or 'auto'"
                raise ValueError(f"encoding: {expected}, but got {self.encoding!r}") from None


AUTOMATIC = CsvOptions()
