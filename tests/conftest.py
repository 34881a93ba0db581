"""What every test run needs: markers, the tests that cannot run here, and a ROS domain of its own."""

from collections import Counter
import fcntl
import importlib.util
import os
from pathlib import Path
import random
import sys
import tempfile
from typing import TextIO

import pytest

ROOT = Path(__file__).resolve().parents[1]  # resolves the link through which colcon comes
SHARED = ROOT.parent / 'shared'
sys.path.append(str(ROOT))  # of the benchmarks, where pytest was started elsewhere

MARKERS = (
    'shared: needs the shared recordings and data sheets beside the checkout',
    'slow: takes more than ten seconds',
    'long: takes minutes; runs with --long (make test-long)',
    'ros: needs rclpy and the built workspace, sourced',
    'issue(n): guards against the return of issue n',
    'asks_for(name): which hidden machine is made and diagnosed for it',
)

# Above 101, the ports of a domain fall into the range from which Linux serves others.
DOMAINS = range(1, 102)


def claim_domain() -> TextIO:
    """Claim a ROS domain that no other test run on this machine has; closing the file frees it."""
    domains = list(DOMAINS)
    random.SystemRandom().shuffle(domains)
    for domain in domains:
        path = Path(tempfile.gettempdir()) / f'escalator_twin_ros_domain_{domain}.lock'
        try:
            lock = path.open('a', encoding='utf-8')
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except (BlockingIOError, PermissionError):
            continue
        os.environ['ROS_DOMAIN_ID'] = str(domain)
        return lock
    raise pytest.UsageError(f'all ROS domains {DOMAINS[0]} to {DOMAINS[-1]} are taken')


def pytest_configure(config: pytest.Config) -> None:
    for marker in MARKERS:
        config.addinivalue_line('markers', marker)
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    config.add_cleanup(claim_domain().close)


def has_module(name: str) -> bool:
    return importlib.util.find_spec(name) is not None


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption('--long', action='store_true', help='run the tests that take minutes too')


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    reasons = {}
    if not config.getoption('--long'):
        reasons['long'] = 'takes minutes: run with --long'
    if not SHARED.is_dir():
        reasons['shared'] = 'no ../shared beside the checkout'
    if not (has_module('rclpy') and has_module('escalator_msgs')):
        reasons['ros'] = (
            'rclpy or escalator_msgs is not there: run make test, or source the workspace'
        )
    for item in items:
        for marker, reason in reasons.items():
            if item.get_closest_marker(marker):
                item.add_marker(pytest.mark.skip(reason=reason))
    # Files run whole, two at a time: those with slow tests first, or one of them is left running alone at the end.
    slow = Counter(
        item.path
        for item in items
        if item.get_closest_marker('slow') and not item.get_closest_marker('skip')
    )
    items.sort(key=lambda item: -slow[item.path])


@pytest.fixture(scope='session')
def root() -> Path:
    """Return the folder of the checkout."""
    return ROOT


@pytest.fixture(scope='session')
def shared() -> Path:
    """Return the folder with the shared recordings; a test that uses it is marked ``shared``."""
    if not SHARED.is_dir():
        pytest.skip('no ../shared beside the checkout')
    return SHARED
