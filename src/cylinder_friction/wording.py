"""Numbers and other programs' words as messages and pages state them."""


def four_digits(value: float) -> str:
    """Write a number with four digits and without a power of ten."""
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"


def counted(count: int, thing: str) -> str:
    """Write a number of things, one without the plural's s."""
    return f"{count} {thing}{'' if count == 1 else 's'}"


def with_unit(number: str, unit: str) -> str:
    """Write a number with its unit; that of a ratio, 1, is not written."""
    return number if unit == "1" else f"{number} {unit}"


def in_brief(error: object, longest: int = 200) -> str:
    """Write an error on one line of at most this many characters."""
    return " ".join(str(error).split())[:longest]


def printable(text: str) -> str:
    """Write text on one line without terminal commands: line ends and other control characters are escaped."""
    return "".join(each if each.isprintable() else f"\\u{ord(each):04x}" for each in text)
