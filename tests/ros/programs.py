"""The nodes as processes of their own."""

from collections.abc import Sequence
from contextlib import contextmanager, suppress
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

TESTS = Path(__file__).resolve().parents[1]
START_S = 120.0  # imports and compiling, on a machine that is busy with other things


class Program:
    """One node, or a module of the tests that runs one; its output goes to a file."""

    def __init__(
        self, name: str, log: Path, parameters: dict[str, Any], args: Sequence[str]
    ) -> None:
        words = [f'{key}:={value}' for key, value in parameters.items()]
        options = [item for word in words for item in ('-p', word)]
        module = name if '.' in name else f'escalator_twin.ros.{name}_node'
        self.log = log
        with log.open('w') as out:
            self.process = subprocess.Popen(
                [sys.executable, '-m', module, '--ros-args', *options, *args],
                stdout=out,
                stderr=subprocess.STDOUT,
                env={
                    **os.environ,
                    'RCUTILS_COLORIZED_OUTPUT': '0',
                    'PYTHONUNBUFFERED': '1',
                    'PYTHONPATH': os.pathsep.join([str(TESTS), *sys.path]),
                },
            )

    @property
    def text(self) -> str:
        return self.log.read_text()

    def wait_for(self, text: str, timeout: float = START_S) -> None:
        limit = time.monotonic() + timeout
        while text not in self.text:
            assert self.process.poll() is None, (
                f'ended with {self.process.returncode}: {self.text}'
            )
            assert time.monotonic() < limit, f'no {text!r} within {timeout} s: {self.text}'
            time.sleep(0.05)

    def wait(self, timeout: float = START_S) -> int:
        return self.process.wait(timeout)

    def interrupt(self, timeout: float = START_S) -> int:
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(timeout)

    def kill(self) -> None:
        with suppress(ProcessLookupError):
            self.process.kill()
        self.process.wait()


@contextmanager
def program(name: str, folder: Path, *args: str, **parameters: Any):
    """Run a node; end it at last, whatever happened."""
    made = Program(name, folder / f'{name}.log', parameters, args)
    try:
        yield made
    finally:
        made.kill()
