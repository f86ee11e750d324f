"""Plan and code prompts come with pictures of the last look, no others do, and a resumed run has the same ones."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image
from test_loop_resumes_from_log import log_in

from memo_core.testing.fake_environment import FakeEnvironment
from memo_core.testing.fake_llm import ScriptedModel
from tests.support.loop_setup import BESIDE, GRASP, NO, NOTES, TEMPLATE, YES, Bench

PICK = "PICK_UP(red cube)"
SCRIPT = {"plan": [PICK, "DONE"], "code": [BESIDE, GRASP], "feedback": [NOTES], "template": [TEMPLATE]}


class Filming(FakeEnvironment):
    """Every picture is another one: its first pixel counts the looks; the second one tells the camera."""

    looks = 0

    def pictures(self, scene):
        self.looks += 1
        return {
            name: np.full((1, 2, 3), [[[self.looks] * 3, [camera] * 3]], np.uint8)
            for camera, name in enumerate(("front", "side"))
        }


def camera_of(data: bytes) -> int:
    return int(np.asarray(Image.open(io.BytesIO(data)))[0, 1, 0])


def shown(model: ScriptedModel) -> dict[str, list[list[bytes]]]:
    found: dict[str, list[list[bytes]]] = {}
    for request in model.asked:
        assert not any(message.images for message in request.messages[:-1])
        found.setdefault(request.phase, []).append([image.data for image in request.messages[-1].images])
    return found


@pytest.mark.process
def test_plan_and_code_prompts_come_with_what_the_cameras_see_now_and_say_which_is_which(sandbox, book):
    bench = Bench(sandbox, book, SCRIPT, [NO, YES], environment=Filming(), session={"images": True})
    bench.run()
    pictures = shown(bench.llm)
    assert all(len(one) == 2 and camera_of(one[0]) == 0 for one in (*pictures["plan"], *pictures["code"]))
    assert pictures["code"][0] != pictures["code"][1], "each of its own look"
    assert not any(one for phase in ("feedback", "template") for one in pictures[phase])
    assert all("in this order: front, side." in text for text in bench.llm.prompts("code"))


def test_without_the_setting_prompts_are_as_ever(sandbox, book):
    bench = Bench(sandbox, book, SCRIPT, [NO, YES])
    bench.run()
    assert not any(image for pictures in shown(bench.llm).values() for image in pictures)
    assert "## Pictures" not in "".join(bench.llm.prompts("code"))


def test_a_resumed_run_asks_with_the_pictures_of_the_look_before_it_was_cut_off(sandbox, book, tmp_path):
    whole = Bench(
        sandbox, book, SCRIPT, [NO, YES], environment=Filming(), session={"images": True, "log": log_in(tmp_path)}
    )
    whole.run()
    lines = (tmp_path / "log.jsonl").read_text().splitlines(keepends=True)
    last = max(number for number, line in enumerate(lines) if '"pictures"' in line)
    (tmp_path / "log.jsonl").write_text("".join(lines[: last + 1]))  # the look is over, nobody has been asked
    again = Bench(
        sandbox, book, SCRIPT, [YES], environment=Filming(), session={"images": True, "log": log_in(tmp_path)}
    )
    again.run()
    first = again.llm.asked[0]
    same = [request for request in whole.llm.asked if request.messages == first.messages]
    assert len(same) == 1 and first.messages[-1].images
