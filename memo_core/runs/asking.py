"""A language model for perception: questions within the budget, in the run's log, with an event each."""

from __future__ import annotations

from collections.abc import Callable

from memo_core.events import Event
from memo_core.interfaces.llm import Answer, LanguageModel, Request
from memo_core.interfaces.perception import Ask
from memo_core.llm.budget import Budget
from memo_core.llm.calls import ModelCalls, Retrying
from memo_core.policy.settings import RunSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.run_log import AsideLog, RunLog


def asking(
    llm: LanguageModel,
    stop: StopSwitch,
    tell: Callable[[Event], None],
    budget: Budget,
    settings: RunSettings,
    log: RunLog | None = None,
) -> Ask:
    """Asks ``llm``, which must be open by then.

    A look is one effect in a run's ``log``, answered from it as a whole when the run is resumed. The questions within
    are asides: their answers are kept, so that a look that was cut off or is repeated asks nothing twice, and their
    cost counts. None: no run, nothing is kept.
    """
    retrying = Retrying(settings.retries, settings.retry_wait_s)

    def ask(question: Request) -> Answer:
        return ModelCalls(llm, stop, AsideLog(log or RunLog()), tell, budget, retrying).answer(question)[0]

    return ask
