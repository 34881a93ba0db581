"""Effects that are on no list: the twin must say that it cannot name them."""

UNLISTED = {}
