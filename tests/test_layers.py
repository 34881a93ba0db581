"""Imports point downwards: the core knows no shell, and only ros/ knows ROS."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import escalator_twin

PACKAGE = Path(escalator_twin.__file__).parent
FILES = sorted(PACKAGE.rglob('*.py'))
# lowest first; what shares a line does not import one another
LAYERS = (
    ('errors', 'memory', 'threads'),
    ('signals',),
    ('schema',),
    ('machine',),
    ('case', 'conversions'),
    ('bagfile', 'physics', 'metrics'),
    ('sync',),
    ('causes',),
    ('instruments', 'twin'),
    ('batch',),
    ('check', 'suggest'),
    ('comparison',),
    ('diagnosis', 'verification'),
    ('report',),
    ('campaign',),
    ('pipeline',),
    ('cli',),
    ('ros',),  # writes and shows as the command line does
)
RANK = {name: rank for rank, names in enumerate(LAYERS) for name in names}
ROS = {'rclpy', 'ament_index_python', 'launch', 'launch_ros'}
ROOT = 'escalator_twin'


def imports(path: Path) -> Iterator[str]:
    """Yield every imported module, lazy imports too."""
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path}:{node.lineno}: relative import'
            if node.module == ROOT:
                yield from (f'{ROOT}.{alias.name}' for alias in node.names)
            elif node.module:
                yield node.module


@pytest.mark.parametrize('path', FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_point_downwards(path):
    home = path.relative_to(PACKAGE).parts[0].removesuffix('.py')
    for name in imports(path):
        root, _, rest = name.partition('.')
        if root == ROOT:
            target = rest.split('.')[0]
            if target == '__version__':
                continue
            assert target == home or RANK[target] < RANK[home], f'{home} imports {target}'
        elif root in ROS or root.endswith('_msgs'):
            assert home == 'ros', f'{home} imports {root}'


def test_every_module_has_a_rank():
    homes = {path.relative_to(PACKAGE).parts[0].removesuffix('.py') for path in FILES}
    assert homes - set(RANK) - {'__init__'} == set()
