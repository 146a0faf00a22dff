"""Markup that cannot forget to escape, and numbers for readers: rounded to their uncertainty, with prefixes."""

import html
import re
from collections.abc import Iterable

import numpy as np

from origami_sim.quantities import ANY
from origami_sim.units import with_prefix

MISSING = "–"
"""Shown where there is no number."""

_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_VOID = {"meta", "path"}


class Html(str):
    """Text that is markup already."""


def element(name: str, /, *children, **attributes) -> Html:
    """One element. Children are escaped unless they are `Html`; lists are flattened, None and False left out.

    Attributes: a trailing underscore is dropped, others become hyphens; True stands alone, None and False vanish.
    """
    text = []
    for key, value in attributes.items():
        if value is None or value is False:
            continue
        key = key.rstrip("_").replace("_", "-")
        text.append(f" {key}" if value is True else f' {key}="{html.escape(str(value))}"')
    if name in _VOID:
        return Html(f"<{name}{''.join(text)}/>")
    return Html(f"<{name}{''.join(text)}>{join(children)}</{name}>")


def join(children: Iterable) -> Html:
    """Children one after the other, escaped unless they are `Html`."""
    out = []
    for child in children:
        if child is None or child is False:
            continue
        if isinstance(child, str):
            out.append(child if isinstance(child, Html) else html.escape(child))
        elif isinstance(child, Iterable):
            out.append(join(child))
        else:
            out.append(html.escape(str(child)))
    return Html("".join(out))


def scaled_unit(value: float, unit: str) -> tuple[float, str]:
    """Factor and readable unit for a size [SI]; no prefix where it would mislead (m^2, 1/s, kg m^2, kilometres)."""
    base = re.split(r"[ /]", unit, maxsplit=1)[0]
    if unit == "kg":
        return with_prefix(value, unit)
    if not re.fullmatch(r"[A-Za-z]+", base) or base in ("kg", "K", "deg"):
        return 1.0, pretty(unit)
    factor, name = with_prefix(value, base)
    if factor < 1.0 and base in ("m", "s", "rad"):
        factor, name = 1.0, base
    return factor, pretty(name + unit[len(base) :])


def pretty(unit: str) -> str:
    """A unit in print: m², s⁻¹; nothing for pure numbers."""
    return "" if unit in ("1", "-", ANY) else raised(unit)


def raised(text: str) -> str:
    """Text with powers as superscripts."""
    return re.sub(r"\^(-?\d+)", lambda m: m[1].translate(_SUPERSCRIPT), text)


def number(value: float, digits: int = 2) -> str:
    """A pure number to so many significant digits."""
    if not np.isfinite(value):
        return MISSING
    return _fixed(value, digits - 1 - _exponent(float(f"{value:.{digits - 1}e}")))


def amount(value: float, unit: str, digits: int = 2) -> str:
    """A quantity [SI] with a readable prefix, to so many significant digits."""
    if not np.isfinite(value):
        return MISSING
    factor, name = scaled_unit(float(f"{value:.{digits - 1}e}"), unit)
    return _with(number(value * factor, digits), name)


def interval(value: float, low: float, high: float, unit: str) -> str:
    """A quantity [SI] with its interval, all rounded to two digits of the half-width: '1.23 mN m (1.18 to 1.28)'."""
    width = (high - low) / 2
    if not np.isfinite([value, width]).all() or width <= 0:
        return amount(value, unit, 3)
    factor, name = scaled_unit(max(abs(value), abs(low), abs(high)), unit)
    decimals = 1 - _exponent(float(f"{width * factor:.1e}"))
    a, b, c = (_fixed(v * factor, decimals) for v in (value, low, high))
    return f"{_with(a, name)} ({b} to {c})"


def plus_minus(value: float, error: float, unit: str = "1", *, sign: bool = False) -> str:
    """A quantity [SI] and its standard error, rounded to two digits of the error."""
    if not np.isfinite(value):
        return MISSING
    if not np.isfinite(error) or error <= 0:
        return ("+" if sign and value > 0 else "") + amount(value, unit, 3)
    factor, name = scaled_unit(max(abs(value), error), unit)
    decimals = 1 - _exponent(float(f"{error * factor:.1e}"))
    text = f"{_fixed(value * factor, decimals)} ± {_fixed(error * factor, decimals)}"
    return ("+" if sign and value > 0 else "") + _with(text, name)


def percent(part: float) -> str:
    """A probability or share: whole percent, and never a false 0 or 100 %."""
    if not np.isfinite(part):
        return MISSING
    if part > 0.995:
        return "> 99 %"
    return "< 1 %" if 0 < part < 0.0095 else f"{100 * part:.0f} %"


def fit_percent(value: float) -> str:
    """A fit %: with a decimal where it is close to 100."""
    if not np.isfinite(value):
        return MISSING
    return _fixed(value, 1 if value >= 90 else 0) + " %" if value > -1000 else "< −1000 %"


def times(value: float) -> str:
    """A multiple: '1.1 ×'."""
    return f"{number(value, 2)} ×" if np.isfinite(value) else MISSING


def _with(text: str, unit: str) -> str:
    return f"{text} {unit}" if unit else text


def _exponent(value: float) -> int:
    return int(np.floor(np.log10(abs(value)))) if value else 0


def _fixed(value: float, decimals: int) -> str:
    """Fixed notation where it is short, powers of ten elsewhere; zero where nothing is left of the digits asked for."""
    value = value if round(value, decimals) else 0.0
    size = _exponent(value)
    if value and (size < -3 or size > 4):
        mantissa = value / 10.0**size
        text = f"{mantissa:.{int(np.clip(decimals + size, 0, 6))}f}×10{str(size).translate(_SUPERSCRIPT)}"
    else:
        kept = round(value, decimals) if decimals < 0 else value
        text = f"{kept:.{max(decimals, 0)}f}"
    return text.replace("-", "−")
