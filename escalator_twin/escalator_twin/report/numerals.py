"""Numbers, units and places as people read them; the filters of the templates."""

from collections.abc import Callable, Mapping
from typing import Any

from escalator_twin.report.documents import number

MISSING = '–'
MINUS = '−'
NARROW = '\u202f'  # no-break space between a number and its unit


def fixed(value: Any, digits: int = 3, unit: str = '', sign: bool = False) -> str:
    """Return a number with a fixed count of decimals, an en dash where there is none."""
    known = number(value)
    if known is None:
        return MISSING
    shown = f'{known:{"+" if sign else ""}.{digits}f}'
    if float(shown) == 0.0:
        shown = shown.lstrip('+-')
    return shown.replace('-', MINUS) + (NARROW + unit if unit else '')


def correlation(value: Any) -> str:
    """Return a correlation to four decimals; what only rounds to 1 is not printed as 1."""
    known = number(value)
    if known is None:
        return MISSING
    return '> 0.9999' if 0.99995 <= known < 1.0 else fixed(known, 4)


def percent(value: Any, digits: int = 1, sign: bool = False) -> str:
    """Return a share in percent."""
    known = number(value)
    return MISSING if known is None else fixed(100.0 * known, digits, '%', sign)


def milli(value: Any, digits: int = 1, unit: str = 'ms', sign: bool = True) -> str:
    """Return a number in thousandths, by default seconds in milliseconds."""
    known = number(value)
    return MISSING if known is None else fixed(1000.0 * known, digits, unit, sign)


def significant(value: Any, digits: int = 4) -> str:
    """Return a number to so many significant digits, without an exponent where that is short."""
    known = number(value)
    if known is None:
        return MISSING
    shown = f'{known:.{digits}g}'
    if 'e' in shown and 1e-5 < abs(known) < 1e7:
        shown = f'{known:.10f}'.rstrip('0').rstrip('.') if abs(known) < 1 else f'{known:.0f}'
    return shown.replace('-', MINUS) if 'e' not in shown else _power(shown)


def _power(shown: str) -> str:
    mantissa, exponent = shown.split('e')
    raised = str(int(exponent)).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))
    return f'{mantissa.replace("-", MINUS)}·10{raised}'


def plain(value: Any) -> str:
    """Return any value of a document as text: what a table shows of a key that it does not know."""
    if value is None:
        return MISSING
    if isinstance(value, bool):
        return 'yes' if value else 'no'
    if isinstance(value, int | float):
        return significant(value)
    if isinstance(value, Mapping):
        if {'value', 'low', 'high'} <= set(value):
            return interval(value)
        return ', '.join(f'{words(key)} {plain(item)}' for key, item in value.items())
    if isinstance(value, list):
        return ', '.join(plain(item) for item in value) or MISSING
    return str(value)


def interval(value: Mapping[str, Any], digits: int = 4) -> str:
    """Return an estimate with its 95 % interval."""
    low, high = number(value.get('low')), number(value.get('high'))
    shown = significant(value.get('value'), digits)
    if low is None or high is None:
        return shown
    return f'{shown} ({significant(low, digits)} to {significant(high, digits)})'


# what the names of the contracts end with, and how that is printed
UNITS = {
    'force_N': 'N',
    '_m_s2': 'm/s²',
    '_m_s': 'm/s',
    '_mps': 'm/s',
    '_hz': 'Hz',
    '_kg': 'kg',
    '_deg': '°',
    '_per_pitch': 'per pitch',
    'ppm': 'ppm',
    '_n': 'N',
    '_m': 'm',
    '_s': 's',
}


def words(key: Any) -> str:
    """Return a key of the JSON as words, its unit taken off."""
    name = str(key)
    for ending in UNITS:
        if ending.startswith('_') and name.endswith(ending) and name != ending:
            name = name.removesuffix(ending) + (' per pitch' if ending == '_per_pitch' else '')
            break
    return name.removesuffix('_N').replace('_', ' ')


def unit_of(key: Any) -> str:
    """Return the unit that a key of the JSON carries, empty where it carries none."""
    for ending, unit in UNITS.items():
        if str(key).endswith(ending):
            return '' if unit == 'per pitch' else unit
    return ''


def place(location: Mapping[str, Any]) -> str:
    """Return where a cause acts, as words."""
    rest = {key: value for key, value in location.items() if value is not None}
    parts = []
    if 's_from_m' in rest and 's_to_m' in rest:
        ends = significant(rest.pop('s_from_m')), significant(rest.pop('s_to_m'))
        parts.append(f's = {ends[0]} to {ends[1]}{NARROW}m')
    for key, value in rest.items():
        if key == 'side':
            parts.append(
                f'{value} side' if value in ('left', 'right') else f'{plain(value)} sides'
            )
        elif key == 's_m':
            parts.append(f's = {plain(value)}{NARROW}m')
        else:
            unit = unit_of(key)
            parts.append(f'{words(key)} {plain(value)}{NARROW + unit if unit else ""}')
    return ', '.join(parts) or MISSING


def told(value: Any, key: Any) -> str:
    """Return a value of a document as its key asks for it: with its unit, a direction as a word."""
    if key == 'direction':
        return direction(value)
    is_numeric = isinstance(value, int | float | list) and not isinstance(value, bool)
    unit = unit_of(key) if is_numeric and plain(value) != MISSING else ''
    return plain(value) + (NARROW + unit if unit else '')


def direction(value: Any) -> str:
    """Return a direction as a word."""
    return {1: 'up', -1: 'down'}.get(value, MISSING) if isinstance(value, int) else MISSING


FILTERS: dict[str, Callable[..., str]] = {
    'correlation': correlation,
    'direction': direction,
    'fixed': fixed,
    'interval': interval,
    'milli': milli,
    'percent': percent,
    'place': place,
    'plain': plain,
    'significant': significant,
    'told': told,
    'unit_of': unit_of,
    'words': words,
}
