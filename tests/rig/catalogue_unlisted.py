"""What is on no list: kinds of effects that the twin must not name, drawn as the listed ones are."""

from rig.instruments import LINKS
from rig.places import (
    any_link,
    any_s,
    ANY_SIDE,
    at_axis,
    at_link,
    at_roller,
    between,
    either,
    factor,
    in_stretch,
    Kind,
    of_machine,
    ONE_SIDE,
    pick,
    Random,
    softer,
    times,
    with_side,
)


def lateral_kink(rng: Random, share: float) -> tuple[dict, dict]:
    return {'s_m': any_s(rng)}, {'offset_m': share * 4e-3}


def bent_axle(rng: Random, share: float) -> tuple[dict, dict]:
    return {'axle': any_link(rng)}, {'offset_m': share * 2e-3}


def crosstalk(rng: Random, share: float) -> tuple[dict, dict]:
    one, other = rng.choice(4, 2, replace=False)
    return {'links': [LINKS[one], LINKS[other]]}, {'share': share * 0.06}


def settled_rail(rng: Random, share: float) -> tuple[dict, dict]:
    place = {'s_m': any_s(rng), 'side': pick(rng, ANY_SIDE)}
    return place, {'depth_m': share * 4e-3, 'length_m': rng.uniform(0.8, 1.4)}


def poor_batch(rng: Random, share: float) -> tuple[dict, dict]:
    return {'axle': any_link(rng)}, {
        'force_N': share * 60.0,
        'one_of': pick(rng, (4, 5, 6)),
    }


def rail_joints(rng: Random, share: float) -> tuple[dict, dict]:
    place = {'s_m': any_s(rng), 'side': 'both'}
    return place, {'height_m': share * 4e-4, 'spacing_m': rng.uniform(1.2, 2.5)}


NOT_LISTED: dict[str, Kind] = {
    'unlisted_stiffening_spring': Kind(of_machine(cubic_n_m3=times(1e9))),
    'unlisted_rubbing_brake': Kind(
        in_stretch(
            (1.0, 3.0), force_N=times(60.0), period_s=between(6.0, 12.0), on_s=between(2.0, 4.0)
        )
    ),
    'unlisted_blows': Kind(of_machine(force_N=times(1500.0), period_s=between(1.5, 4.0))),
    'unlisted_soft_support': Kind(
        with_side(in_stretch((1.0, 3.0), factor=lambda _rng, share: softer(0.15, share)))
    ),
    'unlisted_bent_axle': Kind(bent_axle),
    'unlisted_second_mode': Kind(
        of_machine(
            frequency_hz=between(8.0, 12.0),
            damping_ratio=between(0.02, 0.02),
            modal_mass_kg=lambda _rng, share: 3000.0 / share,
        )
    ),
    'unlisted_swinging_load': Kind(
        of_machine(relative_amplitude=times(0.08), frequency_hz=between(0.5, 1.5)), needs_load=True
    ),
    'unlisted_misplaced_dog': Kind(of_machine(dogs=between(7, 7), offset_m=times(1e-3))),
    'unlisted_slipping_dog': Kind(
        of_machine(
            share_of_peak=lambda _rng, share: 1.0 - 0.04 * share
        )  # more and the chain runs away
    ),
    'unlisted_leaking_preload': Kind(of_machine(rate_1_s=times(1e-3))),
    'unlisted_lateral_kink': Kind(lateral_kink),
    'unlisted_worn_channel': Kind(with_side(in_stretch((1.0, 3.0), play_m=times(1.5e-3)))),
    'unlisted_settled_rail': Kind(settled_rail),
    'unlisted_corrugated_rail': Kind(
        with_side(
            in_stretch((1.0, 3.0), amplitude_m=times(3e-4), wavelength_m=between(0.15, 0.35))
        )
    ),
    'unlisted_high_rail': Kind(
        with_side(in_stretch((1.5, 4.0), height_m=times(1.5e-3)), ONE_SIDE)
    ),
    'unlisted_dry_side': Kind(with_side(of_machine(factor=either(2.0)), ONE_SIDE)),
    'unlisted_poor_batch': Kind(poor_batch),
    'unlisted_alternating_links': Kind(of_machine(length_m=times(3e-4))),
    'unlisted_soft_side': Kind(
        with_side(of_machine(factor=lambda _rng, share: softer(0.7, share)), ONE_SIDE)
    ),
    'unlisted_damped_tensioner': Kind(of_machine(factor=lambda _rng, share: factor(10.0, share))),
    'unlisted_heavy_carriage': Kind(of_machine(mass_kg=times(300.0))),
    'unlisted_warming_grease': Kind(of_machine(rate_1_s=times(3e-3))),
    'unlisted_uneven_loads': Kind(of_machine(sd=times(0.3)), needs_load=True),
    'unlisted_crosstalk': Kind(crosstalk),
    'unlisted_sticking_reflex': Kind(of_machine(band_m=times(2e-4))),
    'unlisted_reflex_gain': Kind(of_machine(factor=either(1.15, 0.85))),
    'unlisted_acceleration_gain': Kind(at_axis(factor=either(1.15, 0.85))),
    'unlisted_late_bridge': Kind(at_link(delay_s=times(0.04))),
    'unlisted_slow_bridge': Kind(at_link(corner_hz=lambda _rng, share: 3.0 / share)),
    'unlisted_jumping_zero': Kind(at_link(strain=times(1.5e-5), at_share=between(0.3, 0.7))),
    'unlisted_drifting_reflex': Kind(of_machine(drift_m=times(5e-4))),
    'unlisted_drifting_accelerometer': Kind(at_axis(drift_m_s2=times(0.1))),
    'unlisted_warming_gauges': Kind(at_link(strain=times(1.5e-5))),
    'unlisted_heavy_side': Kind(with_side(of_machine(factor=either(1.15)), ONE_SIDE)),
    'unlisted_half_loaded': Kind(of_machine(early_m=times(3.0)), needs_load=True),
    'unlisted_thick_grease': Kind(of_machine(factor=lambda _rng, share: factor(8.0, share))),
    'unlisted_damped_links': Kind(of_machine(factor=lambda _rng, share: factor(2.5, share))),
    'unlisted_lower_landing': Kind(of_machine(delta_m=times(6e-3))),
    'unlisted_short_dogs': Kind(of_machine(short_m=times(0.08))),
    'unlisted_noisy_bridge': Kind(at_link(strain=times(6e-6))),
    'unlisted_coarse_bridge': Kind(at_link(strain=times(1.5e-5))),
    'unlisted_bent_reflex': Kind(of_machine(per_m=times(15.0))),
    'unlisted_slow_accelerometer': Kind(of_machine(corner_hz=lambda _rng, share: 4.0 / share)),
    'unlisted_humming_accelerometer': Kind(
        at_axis(amplitude_m_s2=times(0.05), frequency_hz=between(5.0, 12.0))
    ),
    'unlisted_seizing_roller': Kind(at_roller('rate_N_s', 2.0)),
    'unlisted_warming_chain': Kind(of_machine(rate_1_s=times(4e-6))),
    'unlisted_graded_chain': Kind(of_machine(length_m=times(2e-4))),
    'unlisted_soft_tyres': Kind(of_machine(factor=lambda _rng, share: softer(0.4, share))),
    'unlisted_soft_flanks': Kind(of_machine(factor=lambda _rng, share: softer(0.4, share))),
    'unlisted_rail_joints': Kind(rail_joints),
    'unlisted_speed_jump': Kind(of_machine(relative=times(0.02), at_share=between(0.3, 0.7))),
    'unlisted_boarding': Kind(
        of_machine(share=times(0.4), at_s=between(15.0, 35.0)), needs_load=True
    ),
    'unlisted_shaken_carriage': Kind(
        of_machine(force_N=times(200.0), frequency_hz=between(5.0, 9.0))
    ),
    'unlisted_clipped_bridge': Kind(
        at_link(share_of_range=lambda _rng, share: 1.0 - 0.15 * share)
    ),
    'unlisted_stepping_gain': Kind(at_link(factor=either(1.09, 0.91), at_share=between(0.3, 0.7))),
    'unlisted_sticking_bridge': Kind(at_link(band_strain=times(1e-5))),
    'unlisted_bent_bridge': Kind(at_link(share=times(0.04))),
    'unlisted_bursts': Kind(
        at_link(strain=times(1.5e-5), every_s=between(3.0, 8.0), frequency_hz=between(20.0, 40.0))
    ),
    'unlisted_late_accelerometer': Kind(of_machine(delay_s=times(0.04))),
    'unlisted_ringing_accelerometer': Kind(
        at_axis(
            frequency_hz=lambda rng, share: rng.uniform(10.0, 16.0) / share,
            damping_ratio=between(0.05, 0.05),
        )
    ),
    'unlisted_clipped_accelerometer': Kind(
        at_axis(share_of_range=lambda _rng, share: 1.0 - 0.4 * share)
    ),
    'unlisted_held_reflex': Kind(of_machine(hold_s=times(0.1))),
}
