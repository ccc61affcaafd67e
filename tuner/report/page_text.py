"""Format values for a page. Values come from files; whatever is not a number becomes a dash."""

import math
from typing import Any

NONE = "–"
"""Shown in place of a missing value."""
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def finite(value: Any) -> float | None:
    """`value` as a float if it is a finite number, else None."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def words(name: str) -> str:
    """The name of a key as words, for example `vpl_count` as "VPL count"."""
    spoken = {
        **{"vpl": "VPL", "vpls": "VPLs", "rsm": "RSM", "n": "N"},
        **{"sha256": "SHA-256", "jax": "JAX", "opengl": "OpenGL"},
    }
    return " ".join(spoken.get(word, word) for word in name.split("_"))


def number(value: Any, digits: int = 3) -> str:
    """`value` to `digits` significant digits; as a power of ten below 1e-4 and from 1e6 on."""
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
    """A duration in seconds as ms, s, min or h."""
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
    """The change from `before` to `after` in words, for example "75 % less"; empty if unknown."""
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
    """A ratio as a signed percentage, or as a factor from 2 on."""
    known = finite(value)
    if known is None:
        return NONE
    return f"×{known:.2f}" if known >= 2.0 else f"{100.0 * (known - 1.0):+.0f} %".replace("-", "−")
