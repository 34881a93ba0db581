"""Install the Python package, its executables, and its launch and configuration files."""

import os
from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = 'escalator_twin'
SHARE = Path('share') / PACKAGE


def files_below(folder: str) -> list[tuple[str, list[str]]]:
    """Return ``folder`` as data files, each installed below ``share`` at its own place."""
    return [
        (str(SHARE / here), [str(Path(here) / name) for name in sorted(names)])
        for here, _, names in os.walk(folder, followlinks=True)
        if names and '__pycache__' not in here
    ]


def package_files() -> list[str]:
    """Return what the package carries besides Python: templates, schemas."""
    return [
        str(path.relative_to(PACKAGE))
        for path in sorted(Path(PACKAGE).rglob('*'))
        if path.is_file() and path.suffix not in {'.py', '.pyc', '.nbc', '.nbi'}
    ]


setup(
    name=PACKAGE,
    version='0.1.0',
    description='Digital twin of an instrumented escalator: simulate, compare, diagnose.',
    license='Apache-2.0',
    maintainer='Escalator Twin maintainers',
    maintainer_email='maintainers@escalator-twin.example',
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    package_data={PACKAGE: package_files()},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (str(SHARE), ['package.xml']),
        *files_below('launch'),
        *files_below('config'),
    ],
    python_requires='>=3.11',
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},
    zip_safe=False,
    entry_points={
        'console_scripts': [
            f'simulator = {PACKAGE}.ros.simulator_node:main',
            f'comparator = {PACKAGE}.ros.comparator_node:main',
            f'ask = {PACKAGE}.ros.ask_node:main',
            f'escalator-twin = {PACKAGE}.cli.main:main',
        ]
    },
)
