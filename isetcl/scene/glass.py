"""Clear media by name: glasses, plastics and water."""

from __future__ import annotations

from isetcl.errors import check_choice
from isetcl.eye.media import Medium, SellmeierDispersion

_MEDIA = {
    # Source: SCHOTT optical glass catalogue, 2017-01-20.
    "BK7": SellmeierDispersion(
        (1.03961212, 0.231792344, 1.01046945),
        (0.00600069867, 0.0200179144, 103.560653),
        300.0,
        2500.0,
    ),
    "F2": SellmeierDispersion(
        (1.34533359, 0.209073176, 0.937357162),
        (0.00997743871, 0.0470450767, 111.886764),
        320.0,
        2500.0,
    ),
    "SF10": SellmeierDispersion(
        (1.61625977, 0.259229334, 1.07762317),
        (0.0127534559, 0.0581983954, 116.60768),
        380.0,
        2500.0,
    ),
    "SF11": SellmeierDispersion(
        (1.73848403, 0.311168974, 1.17490871),
        (0.0136068604, 0.0615960463, 121.922711),
        390.0,
        2500.0,
    ),
    "N-SF11": SellmeierDispersion(
        (1.73759695, 0.313747346, 1.89878101),
        (0.013188707, 0.0623068142, 155.23629),
        370.0,
        2500.0,
    ),
    # Source: Malitson 1965, J Opt Soc Am 55:1205, 20 degrees C.
    "fused silica": SellmeierDispersion(
        (0.6961663, 0.4079426, 0.8974794),
        (0.0684043**2, 0.1162414**2, 9.896161**2),
        210.0,
        3710.0,
    ),
    # Source: Daimon & Masumura 2007, Appl Opt 46:3811, distilled water at 20 degrees C.
    "water": SellmeierDispersion(
        (5.684027565e-1, 1.726177391e-1, 2.086189578e-2, 1.130748688e-1),
        (5.101829712e-3, 1.821153936e-2, 2.620722293e-2, 1.069792721e1),
        182.0,
        1129.0,
    ),
    # Source: Sultanova, Kasarova & Nikolov 2009, Acta Phys Pol A 116:585, measured from 437 to 1052
    # nm at 20 degrees C; one-term fits of the refractiveindex.info database. The resonances lie
    # at 106 and 146 nm, so the fits are continued to 380 nm.
    "PMMA": SellmeierDispersion((1.1819,), (0.011313,), 380.0, 1052.0),
    "polycarbonate": SellmeierDispersion((1.4182,), (0.021304,), 380.0, 1052.0),
}

_ALIASES = {
    "acrylic": "PMMA",
    "n-bk7": "BK7",
    "pc": "polycarbonate",
    "perspex": "PMMA",
    "plexiglas": "PMMA",
    "quartz glass": "fused silica",
    "silica": "fused silica",
}


def glass(name: str) -> Medium:
    """A clear medium by name, in the visible range and near infrared.

    "BK7", "F2", "SF10", "SF11", "N-SF11", "fused silica", "water", "PMMA" (acrylic) and
    "polycarbonate"; capitals do not matter. Indices are relative to air.

    Raises
    ------
    InvalidInputError
        If the name is unknown; the message lists near matches.
    """
    folded = name.strip().lower() if isinstance(name, str) else name
    by_name = {known.lower(): known for known in _MEDIA}
    wanted = _ALIASES.get(folded, by_name.get(folded, name)) if isinstance(folded, str) else name
    chosen = check_choice("glass", wanted, list(_MEDIA))
    return Medium(chosen, _MEDIA[chosen])
