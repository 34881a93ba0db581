"""The messages: the types of the recordings, and what a reader of a field has to know."""

from collections.abc import Iterator
import json
from pathlib import Path
import re

import pytest
from rosbags.typesys import get_types_from_msg, get_typestore, Stores
from rosbags.typesys.store import Typestore

PACKAGE = Path(__file__).resolve().parents[1] / 'escalator_msgs'
MESSAGES = sorted(PACKAGE.glob('msg/*.msg'))
SERVICES = sorted(PACKAGE.glob('srv/*.srv'))
ACTIONS = sorted(PACKAGE.glob('action/*.action'))

# From metadata.yaml of the prototype's recordings, written by others than this package.
RECORDED_HASHES = {
    'Experiment': 'RIHS01_cbdb752e22ba38fc99956697511e4e02f7993aadbcce969457dfed276b39e313',
    'LinkStrain': 'RIHS01_6fc748205d045eef6efe2c4ea548347b5cfaa7a1f9c20c396aa05f31046fe467',
    'TensionerDisplacement': (
        'RIHS01_20c0eab1e9f5bdfca5a75f5fe691eecbf7c65e9ed6a185f1a758d6dd2c65ef65'
    ),
}

# type, name, comment: as a person reads a line of a message
FIELD = re.compile(r'^(?P<type>[A-Za-z]\S*)\s+(?P<name>[a-z]\w*)\s*(?:#\s*(?P<comment>.*))?$')
UNIT = re.compile(r'^\[[^\]]+\] ')


def fields(path: Path) -> Iterator[tuple[str, str, str]]:
    """Yield type, name and comment of every field of a message or service file."""
    for line in path.read_text(encoding='utf-8').splitlines():
        if line.strip() and not line.lstrip().startswith('#') and line != '---':
            match = FIELD.match(line)
            assert match, f'{path.name}: not a field: {line!r}'
            yield match['type'], match['name'], match['comment'] or ''


@pytest.fixture(scope='module')
def typestore() -> Typestore:
    """Return Jazzy's types with the messages of this package."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = {}
    for path in MESSAGES:
        types.update(get_types_from_msg(path.read_text(), f'escalator_msgs/msg/{path.stem}'))
    store.register(types)
    return store


@pytest.mark.parametrize('name', RECORDED_HASHES)
def test_definitions_are_those_of_the_recordings(name: str, typestore: Typestore) -> None:
    assert typestore.hash_rihs01(f'escalator_msgs/msg/{name}') == RECORDED_HASHES[name]


@pytest.mark.ros
@pytest.mark.parametrize('name', RECORDED_HASHES)
def test_built_types_are_those_of_the_recordings(name: str) -> None:
    """By what is installed beside them; in no node: Fast DDS may spin for ever where one ends as it is found."""
    from ament_index_python.packages import get_package_share_directory

    share = Path(get_package_share_directory('escalator_msgs'))
    built = json.loads((share / 'msg' / f'{name}.json').read_text(encoding='utf-8'))
    hashes = {row['type_name']: row['hash_string'] for row in built['type_hashes']}
    assert hashes[f'escalator_msgs/msg/{name}'] == RECORDED_HASHES[name]


@pytest.mark.ros
@pytest.mark.parametrize('path', MESSAGES + SERVICES + ACTIONS, ids=lambda path: path.stem)
def test_built_package_has_every_definition(path: Path) -> None:
    import escalator_msgs.action
    import escalator_msgs.msg
    import escalator_msgs.srv

    if path.suffix == '.action':
        action = getattr(escalator_msgs.action, path.stem)
        parts = (action.Goal, action.Result, action.Feedback)
        names = [name for part in parts for name in part.get_fields_and_field_types()]
    elif path.suffix == '.msg':
        names = list(getattr(escalator_msgs.msg, path.stem).get_fields_and_field_types())
    else:
        service = getattr(escalator_msgs.srv, path.stem)
        names = [*service.Request.get_fields_and_field_types()]
        names += [*service.Response.get_fields_and_field_types()]
    assert names == [name for _, name, _ in fields(path)]


@pytest.mark.parametrize('path', MESSAGES + SERVICES + ACTIONS, ids=lambda path: path.stem)
def test_every_field_says_its_meaning_and_unit(path: Path) -> None:
    for type_, name, comment in fields(path):
        assert comment, f'{path.name}: {name} has no comment'
        if type_.startswith('float'):
            assert UNIT.match(comment), f'{path.name}: {name} names no unit: {comment!r}'


def test_every_definition_is_built() -> None:
    listed = re.findall(
        r'^\s+((?:msg|srv|action)/\w+\.\w+)$', (PACKAGE / 'CMakeLists.txt').read_text(), re.M
    )
    assert sorted(listed) == sorted(
        f'{path.parent.name}/{path.name}' for path in MESSAGES + SERVICES + ACTIONS
    )
