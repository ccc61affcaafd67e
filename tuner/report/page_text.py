"""Numbers as a page words them. Values come from files: what is no number is a dash."""

import math
from typing import Any

NONE = "–"
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def finite(value: Any) -> float | None:
    """`value` as a float, if it is a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def words(name: str) -> str:
    """A key of a file as one would write it."""
    spoken = {
        **{"vpl": "VPL", "vpls": "VPLs", "rsm": "RSM", "n": "N"},
        **{"sha256": "SHA-256", "jax": "JAX", "opengl": "OpenGL"},
    }
    return " ".join(spoken.get(word, word) for word in name.split("_"))


def number(value: Any, digits: int = 3) -> str:
    """Three significant digits, powers of ten beyond what is easily read."""
    known = finite(value)
    if known is None:
        return NONE
    if known != 0.0 and not 1e-4 <= abs(known) < 1e6:
        mantissa, _, exponent = f"{known:.{digits - 1}e}".partition("e")
        return f"{mantissa} × 10{str(int(exponent)).translate(_SUPERSCRIPTS)}".replace("-", "−")
    text = f"{known:.{digits}g}"
    if "e" in text:
        text = f"{known:,.0f}".replace(",", " ")
    return text.replace("-", "−")


def seconds(value: Any) -> str:
    """A duration in the units that one would say it in."""
    known = finite(value)
    if known is None or known < 0.0:
        return NONE
    if known < 60.0:
        return f"{known:.1f} s" if known >= 0.95 else f"{1000.0 * known:.0f} ms"
    whole = round(known)
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


def change(before: Any, after: Any) -> str:
    """By which share a figure fell or rose."""
    old, new = finite(before), finite(after)
    if old is None or new is None or old <= 0.0:
        return ""
    percent = 100.0 * (new - old) / old
    if abs(percent) < 0.5:
        return "unchanged"
    if new > 2.0 * old:
        return f"{new / old:.1f} times as much"
    return f"{abs(percent):.0f} % {'less' if percent < 0.0 else 'more'}"


def ratio(value: Any) -> str:
    """A ratio as the change that it is."""
    known = finite(value)
    if known is None:
        return NONE
    return f"×{known:.2f}" if known >= 2.0 else f"{100.0 * (known - 1.0):+.0f} %".replace("-", "−")
