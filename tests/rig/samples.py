"""The small recordings that the repository carries, and their manifest."""

import hashlib
import json
from pathlib import Path
import shutil

import yaml

from rig.draw import Wander
from rig.machine import Case
from rig.make import Effect, make, Order, write

# The samples are kept as they were first made, before other makers' wander was known: README and pictures are of them.
GENTLE = Wander(3, 3, 90.0)
SAMPLES: dict[str, Order] = {
    'sample_clean': Order(101, Case(0.5, 1, 75.0, 6000.0), duration_s=65.0, wander=GENTLE),
    'sample_guide_step': Order(
        102,
        Case(0.5, 1, 0.0, 3000.0),
        duration_s=65.0,
        wander=GENTLE,
        effects=(Effect('guide_step', {'s_m': 9.8, 'side': 'left'}, {'height_m': 1.5e-3}),),
    ),
}


def digest(path: Path) -> str:
    """Return a file's SHA-256."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def entry(name: str, directory: Path, truth: dict) -> dict:
    """Return a sample's line of the manifest."""
    file = directory / f'{name}.mcap'
    return {
        'file': f'{name}/{name}.mcap',
        'sha256': digest(file),
        'bytes': file.stat().st_size,
        'duration_s': SAMPLES[name].duration_s,
        'seed': SAMPLES[name].seed,
        'effects': truth['effects'],
        'made_by': 'cd tests && python -m rig samples --out ../bags',
    }


def write_samples(out: Path) -> None:
    """Make every sample anew in ``out``, the truth in ``out/truth``, and the manifest."""
    manifest = {}
    for name, order in SAMPLES.items():
        made = make(order)
        shutil.rmtree(out / name, ignore_errors=True)
        write(made, out / name, out / 'truth' / f'{name}.json')
        manifest[name] = entry(name, out / name, json.loads(json.dumps(made.truth)))
    text = yaml.safe_dump(manifest, sort_keys=True)
    (out / 'manifest.yaml').write_text(text)
