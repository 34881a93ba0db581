"""Effects on no list that come, go or grow within a recording."""

import numpy as np

from rig.causes import Alter, changed, ends_of

BLOW_WIDTH_S = 0.03  # s, of a half sine


def rubbing_brake(model, place, size, _rng):
    """Let a pad rub on the rollers of a stretch for ``on_s`` out of every ``period_s``."""
    return model._replace(
        rub_force=float(size['force_N']),
        rub_from=place['s_from_m'],
        rub_to=place['s_to_m'],
        rub_period=float(size['period_s']),
        rub_on=float(size['on_s']),
    )


def blows(model, _place, size, _rng):
    """Let something strike the carriage at a fixed interval."""
    return model._replace(
        blow_force=float(size['force_N']),
        blow_period=float(size['period_s']),
        blow_width=BLOW_WIDTH_S,
    )


def swinging_load(model, _place, size, _rng):
    """Let the weight of every load swell and sink together."""
    return model._replace(
        swing=float(size['relative_amplitude']), swing_hz=float(size['frequency_hz'])
    )


def leaking_preload(model, _place, size, _rng):
    """Let the preload sink at a relative rate of ``rate_1_s``."""
    return model._replace(preload_rate=-float(size['rate_1_s']))


def warming_grease(model, _place, size, _rng):
    """Let all rollers roll easier and easier at a relative rate of ``rate_1_s``."""
    return model._replace(resistance_rate=-float(size['rate_1_s']))


def seizing_roller(model, place, size, _rng):
    """Let a roller drag more and more, by ``rate_N_s`` from the recording's begin."""
    where = ends_of(model, place['axle'], place['side'])
    return model._replace(seizing=changed(model.seizing, where, lambda v: v + size['rate_N_s']))


def warming_chain(model, _place, size, _rng):
    """Let every link grow at a relative rate of ``rate_1_s`` as the chain warms."""
    return model._replace(rest_rate=float(size['rate_1_s']))


def speed_jump(model, _place, size, _rng):
    """Let the drive run by ``relative`` slower from a share of the recording on."""
    after = np.arange(model.wander.size) >= size['at_share'] * model.wander.size
    return model._replace(wander=model.wander - size['relative'] * after)


def boarding(model, _place, size, _rng):
    """Let a share of the passengers get off everywhere at ``at_s``."""
    return model._replace(boarding_s=float(size['at_s']), boarding=-float(size['share']))


def shaken_carriage(model, _place, size, _rng):
    """Let something out of balance shake the carriage at a fixed frequency."""
    return model._replace(shake_force=float(size['force_N']), shake_hz=float(size['frequency_hz']))


IN_TIME: dict[str, Alter] = {
    'unlisted_rubbing_brake': rubbing_brake,
    'unlisted_blows': blows,
    'unlisted_swinging_load': swinging_load,
    'unlisted_leaking_preload': leaking_preload,
    'unlisted_warming_grease': warming_grease,
    'unlisted_seizing_roller': seizing_roller,
    'unlisted_warming_chain': warming_chain,
    'unlisted_speed_jump': speed_jump,
    'unlisted_boarding': boarding,
    'unlisted_shaken_carriage': shaken_carriage,
}
