"""Owns the channel filters of SAE J211: 4-pole phaseless Butterworth, by the channel frequency class (CFC)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.sensors import check_class

Array = NDArray[np.float64]

CORNER = 2.0775  # corner frequency of one pass over the class; SAE J211-1: both have -3 dB at 1.667 times the class
SLACK = 1.01  # of the sampling rate: output intervals are rounded to whole steps
UNEVEN = 1e-6  # share of the mean interval by which times may be uneven


def cfc_filter(values: Array, interval: float, cfc: float) -> Array:
    """Filter a history as SAE J211-1, Appendix C: a 2-pole Butterworth filter forwards, then backwards.

    Before its start the history is continued with its first value, as before a first touch, and after its end by
    reflection, so that the last value of a history that still rings weighs no more than those before it.

    Args:
        values: history along the first axis, shape (row_count, ...), float64.
        interval: between rows [s].
        cfc: channel frequency class [Hz], 60, 180, 600 or 1000 in the standard.

    Raises:
        RequestError: class, interval or a value is not a finite number (the former above 0), or rows are too far apart
            or too near each other for the class.
    """
    from scipy.signal import butter, sosfiltfilt

    if not (validate.is_number(cfc) and cfc > 0.0):
        raise bad_value("cfc", validate.brief(cfc), "give the channel frequency class, as 60, 180, 600 or 1000 Hz")
    if not (validate.is_number(interval) and interval > 0.0):
        raise bad_value("interval", validate.brief(interval), "give the finite time between rows, above 0 s")
    check_class("cfc", cfc, interval, SLACK)
    given = values
    try:
        values = np.asarray(values, dtype=np.float64)
        len(values)
    except (TypeError, ValueError) as error:
        remedy = "give an array of numbers, rows along its first axis"
        raise bad_value("values", validate.brief(given), remedy) from error
    if len(strange := values[~np.isfinite(values)]):
        remedy = "the filter would spread it over all rows; leave these rows out, or give finite values"
        raise bad_value("values", float(strange[0]), remedy)
    if len(values) < 2:
        return values.copy()
    sections = butter(2, CORNER * cfc, fs=1.0 / interval, output="sos")
    period = int(np.ceil(1.0 / (CORNER * cfc * interval)))  # rows after which the filter has forgotten its start
    count = min(len(values) - 1, 2 * period)
    seen = np.concatenate([np.repeat(values[:1], count, axis=0), values, values[-2 : -2 - count : -1]])
    return np.asarray(sosfiltfilt(sections, seen, axis=0, padlen=0))[count : count + len(values)]


def is_even(time: Array) -> bool:
    """Whether rows are evenly spaced; those of swings and impacts in turn are not.

    Args:
        time: of each row [s], shape (row_count,).
    """
    steps = np.diff(time)
    if not len(steps):
        return True
    mean, rounding = float(steps.mean()), 4.0 * float(np.spacing(np.abs(time).max()))
    return float(np.abs(steps - mean).max()) <= max(UNEVEN * mean, rounding)
