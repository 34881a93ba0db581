"""A pool that works in this process, and stand-ins for what a campaign asks of it."""

from types import SimpleNamespace

from escalator_twin import campaign


class Pool:
    """Does one thing after another."""

    def __init__(self, _):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    map = staticmethod(map)


def stand_in(monkeypatch, **by):
    """Let a campaign work without recordings: in this process, with what is given by name."""
    always = {
        'ProcessPoolExecutor': Pool,
        'experiment_of': lambda *_: None,
        'load_machine': lambda _: SimpleNamespace(tolerances={}),
        'law_of': lambda *_: None,
        'fit_bags': lambda *_: None,
    }
    for name, one in {**always, **by}.items():
        monkeypatch.setattr(campaign, name, one)
