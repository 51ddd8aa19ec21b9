"""From the frequency and level of a tone to what an ear makes of them: Bark and sone.

    z = 6 asinh(f/600)                                                                [Wang, Sekey, Gersho 1992, eq. 3]
    L_N = 40 lg B + 94 phon,  B = (0.4·10^((L_p + L_U)/10 − 9))^α − (0.4·10^((T + L_U)/10 − 9))^α + 0.005135
                                                                                      [ISO 226:2003, eq. 2, table 1]
    N = 2^((L_N − 40)/10) sone from 40 phon on [ISO 532-1:2017, eq. 1; Stevens 1955],
    N = (L_N/40)^2.642 below                                                          [Bladon, Lindblom 1981, eq. 3]

α, L_U, T: exponent, gain at 1 kHz and threshold of hearing of ISO 226's table at a frequency. The standard vouches for
20 to 90 phon (80 above 4 kHz) and 20 Hz to 12.5 kHz; elsewhere the formula is carried on, α and L_U held, T led on to
18.4 dB at 14 kHz and 40.2 dB at 16 kHz [ISO 389-7:2005, table 1, free field] and held there. L_N below 0 is silence.
The two laws of N meet at 40 phon with slopes 5 % apart.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def bark(freq_hz: Array | float) -> Array:
    """Critical-band rate in Bark."""
    return np.asarray(6 * np.arcsinh(np.asarray(freq_hz) / 600))


def bark_to_hz(rate_bark: Array | float) -> Array:
    """Frequency in Hz of a critical-band rate in Bark."""
    return np.asarray(600 * np.sinh(np.asarray(rate_bark) / 6))


def _row(freq_hz: Array | float) -> tuple[Array, Array, Array]:
    # ISO 226:2003, table 1: f in Hz, α, L_U in dB, T in dB; the last two rows are ISO 389-7's. The standard is not
    # free: all rows agree, digit by digit, with public implementations that hold a copy (Tackett 2005, iso226.m;
    # Callegari 2013, PyDSM; openMHA's MHAUtils::spl2hl for 14 and 16 kHz).
    table = np.array(
        [
            (20, 0.532, -31.6, 78.5),
            (25, 0.506, -27.2, 68.7),
            (31.5, 0.480, -23.0, 59.5),
            (40, 0.455, -19.1, 51.1),
            (50, 0.432, -15.9, 44.0),
            (63, 0.409, -13.0, 37.5),
            (80, 0.387, -10.3, 31.5),
            (100, 0.367, -8.1, 26.5),
            (125, 0.349, -6.2, 22.1),
            (160, 0.330, -4.5, 17.9),
            (200, 0.315, -3.1, 14.4),
            (250, 0.301, -2.0, 11.4),
            (315, 0.288, -1.1, 8.6),
            (400, 0.276, -0.4, 6.2),
            (500, 0.267, 0.0, 4.4),
            (630, 0.259, 0.3, 3.0),
            (800, 0.253, 0.5, 2.2),
            (1000, 0.250, 0.0, 2.4),
            (1250, 0.246, -2.7, 3.5),
            (1600, 0.244, -4.1, 1.7),
            (2000, 0.243, -1.0, -1.3),
            (2500, 0.243, 1.7, -4.2),
            (3150, 0.243, 2.5, -6.0),
            (4000, 0.242, 1.2, -5.4),
            (5000, 0.242, -2.1, -1.5),
            (6300, 0.245, -7.1, 6.0),
            (8000, 0.254, -11.2, 12.6),
            (10000, 0.271, -10.7, 13.9),
            (12500, 0.301, -3.1, 12.3),
            (14000, 0.301, -3.1, 18.4),
            (16000, 0.301, -3.1, 40.2),
        ]
    )
    where = np.log(np.maximum(np.asarray(freq_hz, float), 1e-3))
    nodes = np.log(table[:, 0])
    exponent, gain, threshold = (np.interp(where, nodes, table[:, column]) for column in (1, 2, 3))
    return exponent, gain, threshold


def phon(level_db_spl: Array | float, freq_hz: Array | float) -> Array:
    """Loudness level in phon, not below 0, of a tone of that level; arguments broadcast.

    Source: ISO 226:2003, eq. 2.
    """
    exponent, gain, threshold = _row(freq_hz)
    level = (0.4 * 10 ** ((np.asarray(level_db_spl) + gain) / 10 - 9)) ** exponent
    quiet = (0.4 * 10 ** ((threshold + gain) / 10 - 9)) ** exponent
    return np.asarray(np.maximum(40 * np.log10(np.maximum(level - quiet + 0.005135, 1e-9)) + 94, 0.0))


def sone(loudness_level_phon: Array | float) -> Array:
    """Loudness in sone of a loudness level in phon."""
    level: Array = np.maximum(np.asarray(loudness_level_phon, float), 0.0)
    return np.where(level >= 40, 2 ** ((level - 40) / 10), (level / 40) ** 2.642)


def loudness(power: Array | float, freq_hz: Array | float, full_scale_db_spl: float) -> Array:
    """Sone of a tone with mean square ``power``, 1 standing for ``full_scale_db_spl``."""
    level: Array = 10 * np.log10(np.maximum(np.asarray(power, float), 1e-60)) + full_scale_db_spl
    return sone(phon(level, freq_hz))
