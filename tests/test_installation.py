"""What a fresh clone is built from."""

import importlib.util
from pathlib import Path
import re
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]
LOCKS = sorted((ROOT / 'requirements').glob('*-py3*.txt'))


@pytest.fixture(scope='module')
def fix_ros_wheels() -> ModuleType:
    path = ROOT / 'tools' / 'fix_ros_wheels.py'
    spec = importlib.util.spec_from_file_location('fix_ros_wheels', path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_repair_puts_existing_directories_and_repeats_harmlessly(
    fix_ros_wheels: ModuleType,
) -> None:
    before = (
        '"${_IMPORT_PREFIX}/include/x;/opt/python/cp311-cp311/include/python3.11;'
        '/opt/python/cp311-cp311/lib/python3.11/site-packages/numpy/_core/include"'
    )
    after = fix_ros_wheels.repair(before, '/here/python', '/here/numpy')
    assert after == '"${_IMPORT_PREFIX}/include/x;/here/python;/here/numpy"'
    assert fix_ros_wheels.repair(after, '/here/python', '/here/numpy') == after


def test_a_lock_for_every_supported_python() -> None:
    assert {path.name for path in LOCKS} == {
        f'{kind}-py3{minor}.txt' for kind in ('lock', 'bench') for minor in (11, 12, 13)
    }


@pytest.mark.parametrize('path', LOCKS, ids=lambda path: path.name)
def test_locks_pin_versions_and_hashes_and_name_no_address(path: Path) -> None:
    text = path.read_text(encoding='utf-8')
    assert '://' not in text
    assert '--index' not in text
    entries = re.findall(
        r'^(?!#)(\S.*)((?:\n    --hash=sha256:[0-9a-f]{64}(?: \\)?)*)', text, re.M
    )
    assert entries
    for requirement, hashes in entries:
        assert re.match(r'[a-z0-9-]+(\[[a-z,-]+\])?==\S+', requirement), requirement
        assert hashes, f'{requirement} has no hash'
