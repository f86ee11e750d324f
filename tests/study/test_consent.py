"""Nobody real is shown the sample, and a text says what it must."""

from __future__ import annotations

import io

import pytest

from memo_core.cli.study import AtTerminal
from memo_core.errors import InvalidArgument
from memo_core.interfaces.reception import Demographics
from memo_core.study.consent import MUST_SAY, check_for_people, read_consent
from memo_core.study.settings import Participant


def test_the_sample_says_what_a_text_must_and_is_refused_for_people():
    sample = read_consent("")
    assert sample.sample and all(word in sample.text.lower() for word in MUST_SAY.values())
    check_for_people(sample, [])
    with pytest.raises(InvalidArgument, match="no text for real people \\(P01\\)"):
        check_for_people(sample, ["P01"])


def test_a_copy_of_the_sample_is_refused_too(tmp_path):
    (tmp_path / "text.txt").write_text(read_consent("").text)
    with pytest.raises(InvalidArgument, match="no text for real people"):
        check_for_people(read_consent(str(tmp_path / "text.txt")), ["P01"])


def test_a_text_of_ones_own_is_accepted_and_known_by_its_digest(tmp_path):
    (tmp_path / "text.txt").write_text("Words go to the provider of the model. You may withdraw.")
    consent = read_consent(str(tmp_path / "text.txt"))
    check_for_people(consent, ["P01"])
    assert not consent.sample and consent.digest != read_consent("").digest


def test_a_text_that_does_not_say_how_to_withdraw_is_refused(tmp_path):
    (tmp_path / "text.txt").write_text("Words go to the provider of the model.")
    with pytest.raises(InvalidArgument, match="how to withdraw"):
        read_consent(str(tmp_path / "text.txt"))


@pytest.mark.parametrize("name", ["Anna", "anna smith", "a.smith@lab.org", ""])
def test_a_name_is_no_id(name):
    with pytest.raises(InvalidArgument, match="may be a name"):
        Participant(name)


@pytest.mark.parametrize(
    ("typed", "agrees"),
    [(["I agree!"], True), (["'I agree'"], True), (["", "ja", "yes", "i agree."], True), (["no!"], False)],
)
def test_only_the_words_of_consent_are_consent_and_others_are_asked_back(monkeypatch, typed, agrees):
    monkeypatch.setattr("sys.stdin", io.StringIO("".join(f"{line}\n" for line in typed)))
    assert AtTerminal().agrees("P01", "You may withdraw.") is agrees


def test_an_age_is_asked_for_until_it_is_a_number_or_left_open(monkeypatch, capsys):
    typed = ["abc", "-3", "9" * 5000, "30!", "f", "", "none"]
    monkeypatch.setattr("sys.stdin", io.StringIO("".join(f"{line}\n" for line in typed)))
    told = AtTerminal().about("P01", Demographics())
    assert (told.age, told.gender, told.robots, told.language_models) == (30, "f", None, "none")
    assert "a whole number of years" in capsys.readouterr().err
