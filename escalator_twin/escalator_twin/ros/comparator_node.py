"""The comparator as a node: a recording or live loggers beside the simulator."""

import sys
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from std_srvs.srv import Trigger

from escalator_msgs.msg import Comparison, QualityFinding
from escalator_twin import pipeline
from escalator_twin.ros import comparator_status, diagnostics, qos
from escalator_twin.ros.apart import Diagnose
from escalator_twin.ros.comparing import Comparing, Topics
from escalator_twin.ros.diagnosing import Diagnosing
from escalator_twin.ros.files import check_writable, find_machine
from escalator_twin.ros.inbox import Inbox
from escalator_twin.ros.listening import Listening
from escalator_twin.ros.parameters import declare
from escalator_twin.ros.replay import Replay
from escalator_twin.ros.replaying import replay
from escalator_twin.ros.settings import ComparatorSettings
from escalator_twin.ros.spin import Program, run
from escalator_twin.ros.worker import Worker

NAME = 'comparator'
DIAGNOSTICS_PERIOD_S = 1.0
ADAPT_PERIOD_S = 0.5  # between two looks at what publishers offer


class ComparatorNode(Program):
    """Sets the simulator beside a recording, or beside what it hears, and publishes metrics."""

    def __init__(self, diagnose: Diagnose = pipeline.diagnose) -> None:
        super().__init__(NAME)
        self.settings = declare(self, ComparatorSettings)
        self.machine = find_machine(self.settings.machine)
        check_writable(self.settings.json)
        self.replay = Replay(self, self.settings.bag, self.machine) if self.settings.bag else None
        topics = Topics(
            self.create_publisher(Comparison, f'{NAME}/comparison', qos.EVENTS),
            self.create_publisher(Comparison, f'{NAME}/summary', qos.LATCHED),
            self.create_publisher(QualityFinding, f'{NAME}/quality', qos.FINDINGS),
        )
        self._status = self.create_publisher(DiagnosticArray, '/diagnostics', qos.EVENTS)
        self.comparing = Comparing(self, self.settings, self.machine, topics)
        self.simulated = Inbox(self, self.comparing.link.sources())
        self.simulated.start()
        self.listening = None if self.replay else Listening(self, self.comparing)
        heard = self.listening.messages if self.listening else list
        self.diagnosing = Diagnosing(self, self.comparing, diagnose, heard)
        self.create_service(Trigger, f'{NAME}/summarise', self._on_summarise)
        self.create_timer(DIAGNOSTICS_PERIOD_S, self._report)
        self._worker = Worker(self._do, 'comparison')
        self._worker.start()

    def _do(self) -> None:
        if self.replay is not None:
            replay(self.comparing, self.replay)
        elif self.listening is not None:
            self.listening.listen()

    def is_over(self) -> bool:
        """Tell whether the process may end; raise what made the comparison fail."""
        session = self.comparing.session
        for failure in (self.simulated.failure, session.failure if session else None):
            if failure is not None:
                raise failure
        return self._worker.is_done() and self.settings.exit_at_end

    def close(self) -> None:
        """Stop threads, finish the session."""
        self.comparing.closing.set()
        self.diagnosing.close()
        self._worker.close()
        self.simulated.close()
        if self.listening is not None:
            self.listening.close()
        self.comparing.close()

    def _on_summarise(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self.listening is not None
        if self.listening is not None:
            self.listening.summarise()
        else:
            response.message = 'a replay is summarised at its end'
        return response

    def _report(self) -> None:
        if self.listening is not None:
            self.listening.adapt()
        values: dict[str, Any] = comparator_status.values_of(self.comparing)
        values['diagnosis'] = self.diagnosing.state
        if self.replay is not None:
            values['measured messages played'] = self.replay.sender.sent
            values['measured messages not taken'] = self.replay.sender.failed
        if self.listening is not None:
            values |= self.listening.values()
        level, message = comparator_status.level_of(self.comparing)
        stamp = self.get_clock().now().to_msg()
        self._status.publish(
            diagnostics.array(stamp, f'{self.get_name()}: {self.machine.name}', level, message,
                              values)
        )  # fmt: skip


def main() -> int:
    """Run the node; the program ``comparator``."""
    return run(ComparatorNode, NAME)


if __name__ == '__main__':
    sys.exit(main())
