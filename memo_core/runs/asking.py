"""The experiment's language model for perception: questions within the budget, with an event each."""

from __future__ import annotations

from collections.abc import Callable

from memo_core.events import Event
from memo_core.interfaces.llm import Answer, LanguageModel, Request
from memo_core.interfaces.perception import Ask
from memo_core.llm.budget import Budget
from memo_core.llm.calls import ModelCalls, Retrying
from memo_core.policy.settings import RunSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.run_log import RunLog


def asking(
    llm: LanguageModel, stop: StopSwitch, tell: Callable[[Event], None], budget: Budget, settings: RunSettings
) -> Ask:
    """Asks ``llm``, which must be open by then. A look is one effect in a run's log, answered from it as a whole when
    the run is resumed; the questions within are not in the log."""
    retrying = Retrying(settings.retries, settings.retry_wait_s)

    def ask(question: Request) -> Answer:
        log = RunLog()  # in memory
        return ModelCalls(llm, stop, log, tell, budget, retrying).answer(question)[0]

    return ask
