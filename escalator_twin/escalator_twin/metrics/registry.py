"""All metrics of a channel by name; a new one is a function and a line here."""

from collections.abc import Callable

from escalator_twin.metrics.agreement import (
    spectrum_correlation,
    SPECTRUM_SAMPLES,
)
from escalator_twin.metrics.bands import Bands
from escalator_twin.metrics.ceiling import (
    ceiling_r_time,
    ceiling_share,
    ripple_ceiling,
    trend_ceiling,
)
from escalator_twin.metrics.filters import thinning
from escalator_twin.metrics.iso import iso_18571
from escalator_twin.metrics.lag import remaining_lag
from escalator_twin.metrics.orders import order_scores
from escalator_twin.metrics.track import LOW_HZ
from escalator_twin.metrics.validation import area_metric, sprague_geers, theil

Values = dict[str, float | None]
Score = float | None | Values | list[Values]
Metric = Callable[[Bands], Score]

# keys of a channel in the JSON of `compare`, in its order
CONTRACT = (
    'r_time',
    'r_freq',
    'nrmse',
    'lag_s',
    'ceiling_r_time',
    'ceiling_share',
    'ripple_r',
    'ripple_nrmse',
    'ripple_ceiling',
    'orders',
)


def _lag_s(bands: Bands) -> float | None:
    """Return the delay left between the signals below 2 Hz, s."""
    track = bands.track
    valid = None if bands.valid.all() else bands.valid
    return remaining_lag(*bands.low, track.rate_hz, track.kept, valid)


def _r_freq(bands: Bands) -> float | None:
    """Return the correlation of the amplitude spectra up to 2 Hz; gaps stay bridged."""
    kept = bands.track.kept
    measured, simulated = bands.low
    return spectrum_correlation(measured[kept], simulated[kept], bands.track.rate_hz, LOW_HZ)


def _orders(bands: Bands) -> list[Values]:
    """Return ratio, phase and coherence at each order of the machine."""
    return [
        {
            'cycles_per_pitch': score.cycles_per_pitch,
            'amplitude_ratio': score.amplitude_ratio,
            'phase_deg': score.phase_deg,
            'coherence': score.coherence,
        }
        for score in order_scores(bands)
    ]


def _share_of_ceiling(bands: Bands) -> Values:
    """Return the correlations as shares of what the measurement reaches against itself."""
    return {
        'r_time': _share(bands.low_kept.products.correlation, ceiling_r_time(bands)),
        'ripple_r': _share(bands.ripple_kept.products.correlation, ripple_ceiling(bands)),
        'trend_r': _share(bands.trend_kept.products.correlation, trend_ceiling(bands)),
    }


def _area_metric(bands: Bands) -> float | None:
    """Return the area metric of the signals below 2 Hz, on as few samples as these need."""
    step = thinning(bands.track.rate_hz, SPECTRUM_SAMPLES * LOW_HZ)
    measured, simulated = bands.low_kept
    return area_metric(measured[::step], simulated[::step])


def _share(score: float | None, ceiling: float | None) -> float | None:
    """Return ``score`` over ``ceiling``, ``None`` where the ceiling says nothing."""
    if score is None or ceiling is None or not ceiling > 0.0:
        return None
    return score / ceiling


METRICS: dict[str, Metric] = {
    # contracts.md, JSON of `compare`
    'r_time': lambda bands: bands.low_kept.products.correlation,
    'r_freq': _r_freq,
    'nrmse': lambda bands: bands.low_kept.products.nrmse,
    'lag_s': _lag_s,
    'ceiling_r_time': ceiling_r_time,
    'ceiling_share': ceiling_share,
    'ripple_r': lambda bands: bands.ripple_kept.products.correlation,
    'ripple_nrmse': lambda bands: bands.ripple_kept.products.nrmse,
    'ripple_ceiling': ripple_ceiling,
    'orders': _orders,
    # accelerations below 0.2 Hz, Cano-Moreno et al., section V.B
    'r_time_slow': lambda bands: bands.slow.products.correlation,
    # 20 Hz low-pass, as `nrmse_band_*` of `diagnose`
    'r_band': lambda bands: bands.band_kept.products.correlation,
    'nrmse_band': lambda bands: bands.band_kept.products.nrmse,
    # mean, trend and ripple apart; a mean is an instrument's zero and no agreement
    'mean_difference': lambda bands: bands.mean[1] - bands.mean[0],
    'trend_r': lambda bands: bands.trend_kept.products.correlation,
    'trend_nrmse': lambda bands: bands.trend_kept.products.nrmse,
    'trend_ceiling': trend_ceiling,
    # scores as shares of what the measurement reaches against itself
    'share_of_ceiling': _share_of_ceiling,
    # standard scores, signals below 2 Hz
    'sprague_geers': lambda bands: sprague_geers(bands.low_kept.products),
    'theil': lambda bands: theil(bands.low_kept.products),
    'area_metric': _area_metric,
    'iso_18571': iso_18571,
}


# by their cost: seconds a channel, and a library of their own
SLOW = ('iso_18571',)
QUICK = tuple(name for name in METRICS if name not in SLOW)


def score(bands: Bands, names: tuple[str, ...] = CONTRACT) -> dict[str, Score]:
    """Return the named metrics of one channel; ``None`` where one is undefined."""
    return {name: METRICS[name](bands) for name in names}
