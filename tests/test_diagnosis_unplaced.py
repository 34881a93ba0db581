"""A recording whose place in the loop is not certain is not judged beside a machine."""

from dataclasses import replace
from types import SimpleNamespace

from pools import stand_in
import pytest
import trials

from escalator_twin import bagfile, campaign
from escalator_twin.cli.diagnose import show
from escalator_twin.comparison.locate import locate
from escalator_twin.diagnosis.campaign import decide
from escalator_twin.diagnosis.confirm import confirm_recording
from escalator_twin.diagnosis.diagnose import diagnose_recording
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.recordings import mean_candidates
from escalator_twin.sync.place import clear_lead

pytestmark = pytest.mark.issue(6)

FRICTION = Proposal('tensioner_friction', {}, {'force_N': 150.0}, 1e3, fitted=('force_N',))


@pytest.fixture(scope='module')
def carriage_alone(root):
    """Return the sample's tensioner: its motion is the same after every pitch."""
    recording = bagfile.read(root / 'bags' / 'sample_clean', trials.prototype())
    kept = {c: s for c, s in recording.signals.items() if c.startswith('tensioner')}
    return replace(recording, signals=kept)


def test_a_short_recording_has_to_lead_by_more():
    # a log-likelihood of 24, four samples a second of a signal below 2 Hz
    assert clear_lead(60.0) == pytest.approx(24.0 / (60.0 * 4.0 / 2.0))
    assert clear_lead(15.0) == pytest.approx(24.0 / (15.0 * 4.0 / 2.0))
    assert clear_lead(600.0) == clear_lead(60.0)


def test_nothing_of_the_machine_is_said(carriage_alone):
    found = diagnose_recording(carriage_alone, trials.prototype())
    assert not found.is_placed
    assert (found.effects, found.candidates, found.found, found.deviations) == ([], [], (), ())
    assert not found.unexplained.significant
    (line,) = found.would_change
    assert 'place in the loop is not certain' in line


def test_faults_that_show_without_a_machine_are_told(carriage_alone):
    (signal,) = carriage_alone.signals.values()
    kept = (signal.stamp_ns < signal.stamp_ns[0] + 10_000_000_000) | (
        signal.stamp_ns > signal.stamp_ns[0] + 14_000_000_000
    )
    cut = replace(
        signal,
        stamp_ns=signal.stamp_ns[kept],
        bag_ns=signal.bag_ns[kept],
        values=signal.values[kept],
        parts=signal.parts[kept],
    )
    found = diagnose_recording(
        replace(carriage_alone, signals={signal.channel: cut}), trials.prototype()
    )
    assert [effect['cause'] for effect in found.effects] == ['data_gap']
    assert [row['cause'] for row in found.candidates] == ['data_gap']


def test_beside_others_effects_it_neither_confirms_nor_contradicts(carriage_alone):
    one = confirm_recording(carriage_alone, trials.prototype(), [FRICTION])
    assert one.effects == (FRICTION,)
    assert one.sd == ({},)
    assert one.held_out.channels is None
    assert not one.is_open
    group = [(Found(FRICTION, 0.9, {'force_N': 5.0}, 500.0, ()), 0.9)]
    with_it, without = (decide([group], 2, others)[0] for others in ([one], []))
    assert with_it == without


def test_no_size_is_fitted_to_it(monkeypatch):
    given = []
    monkeypatch.setattr(campaign, 'load_machine', lambda _: None)
    monkeypatch.setattr(campaign, 'load_floor', lambda _: None)
    monkeypatch.setattr(campaign.bagfile, 'read', lambda path, _: path)
    monkeypatch.setattr(
        campaign,
        'prepare_tolerances',
        lambda path, *_: SimpleNamespace(
            setting=SimpleNamespace(is_certain=path != 'b'), path=path
        ),
    )
    monkeypatch.setattr(
        campaign, 'fitted_together', lambda contexts, scouts, *_: given.append((contexts, scouts))
    )
    scouts = [SimpleNamespace(name='a'), SimpleNamespace(name='b'), None]
    campaign.fit_bags(['a', 'b', 'c'], 'machine', scouts, [])
    ((contexts, kept),) = given
    assert [c.path for c in contexts] == ['a', 'c']
    assert kept == [scouts[0], None]
    campaign.fit_bags(['b', 'c'], 'machine', [scouts[1], None], [])
    assert len(given) == 1


def test_the_command_says_so():
    rest = {'significant': False, 'share': 0.0, 'signature': {}}
    document = {
        'recordings': [{'path': 'a.mcap', 'place_is_certain': False}],
        'effects': [],
        'unexplained': rest,
        'gain': {'held_out': None, 'split': 'nothing was accepted'},
        'extended_machine': 'out.yaml',
    }
    text = show(document)
    assert text.startswith('a.mcap: its place in the loop is not certain: not judged\n')
    assert 'within tolerance' not in text
    document['recordings'].append({'path': 'b.mcap', 'place_is_certain': True})
    assert 'within tolerance' in show(document)


def test_a_whole_recording_is_certain(root):
    setting = locate(
        bagfile.read(root / 'bags' / 'sample_clean', trials.prototype()), trials.prototype()
    )
    assert setting.is_certain
    assert setting.lead > 10.0 * setting.least_lead


@pytest.mark.parametrize(('other', 'named'), [('unplaced', True), ('clean', False)])
def test_what_was_not_judged_is_no_search_that_names_nothing(other, named, monkeypatch):
    """Of three that were judged, one alone has named it; of two, one in two."""

    class EnoughError(Exception):
        """It was decided."""

    found = Found(FRICTION, 0.99, {'force_N': 5.0}, 500.0, ())

    def search(path, **_):
        rows = ((found, 0.99),) if path == 'drag' else ()
        is_placed = path != 'unplaced'
        return SimpleNamespace(found=rows, left=None, rolled=None, is_placed=is_placed)

    def confirm(*_, **__):
        return SimpleNamespace(effects=(FRICTION,), sd=({},), rolled=None)

    def by_speed(joint, *_):
        raise EnoughError([one.found.proposal.cause for one in joint])

    stand_in(monkeypatch, diagnose_bag=search, confirm_bag=confirm, by_speed=by_speed)
    with pytest.raises(EnoughError) as raised:
        campaign.diagnose_together(['drag', 'good', other], 'machine.yaml')
    assert raised.value.args == (['tensioner_friction'] if named else [],)


def test_what_was_not_judged_speaks_against_no_candidate():
    row = {'cause': 'roller_drag', 'location': {'axle': 44}, 'probability': 0.9}
    judged = SimpleNamespace(is_placed=True, candidates=[row])
    other = SimpleNamespace(is_placed=True, candidates=[])
    unplaced = SimpleNamespace(is_placed=False, candidates=[])
    (alone,) = mean_candidates([judged, unplaced])
    (beside,) = mean_candidates([judged, other, unplaced])
    assert alone['probability'] == pytest.approx(0.9)
    assert beside['probability'] == pytest.approx(0.45)
    assert mean_candidates([unplaced]) == []
