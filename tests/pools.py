"""A pool that works in this process, for tests of what is asked of it."""


class Pool:
    """Does one thing after another."""

    def __init__(self, _):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    map = staticmethod(map)
