"""An address that other machines can reach needs a token, and TLS or a named proxy."""

from __future__ import annotations

import pytest
from memo_web.settings import WebSettings

from memo_core.plugin import InvalidArgument

TOKEN = "a-token-of-some-length"


@pytest.fixture(autouse=True)
def no_token(monkeypatch):
    monkeypatch.delenv("MEMO_WEB_TOKEN", raising=False)


@pytest.mark.parametrize("address", ["127.0.0.1", "127.0.0.9", "localhost", "::1"])
def test_this_machine_alone_needs_nothing(address):
    assert WebSettings(address=address).checked_token() == ""


@pytest.mark.parametrize("address", ["0.0.0.0", "::", "192.168.1.7", "lab-pc"])
def test_any_other_address_needs_a_token_and_encryption(address, monkeypatch, tmp_path):
    with pytest.raises(InvalidArgument, match="without a token"):
        WebSettings(address=address).checked_token()
    monkeypatch.setenv("MEMO_WEB_TOKEN", TOKEN)
    with pytest.raises(InvalidArgument, match="without encryption"):
        WebSettings(address=address).checked_token()
    assert WebSettings(address=address, proxy="https://robots.example").checked_token() == TOKEN
    for name in ("certificate", "key"):
        (tmp_path / name).write_text("PEM")
    files = {"tls_certificate": str(tmp_path / "certificate"), "tls_key": str(tmp_path / "key")}
    assert WebSettings(address=address, **files).checked_token() == TOKEN


def test_a_short_token_is_refused(monkeypatch):
    monkeypatch.setenv("MEMO_WEB_TOKEN", "robot")
    with pytest.raises(InvalidArgument, match=r"MEMO_WEB_TOKEN.*5 characters"):
        WebSettings().checked_token()


@pytest.mark.parametrize(
    "proxy", ["http://robots.example", "robots.example", "https://robots.example/memo", "https://"]
)
def test_a_proxy_without_tls_is_refused(proxy):
    with pytest.raises(InvalidArgument, match="proxy"):
        WebSettings(proxy=proxy)


def test_a_certificate_goes_with_its_key(tmp_path):
    with pytest.raises(InvalidArgument, match="one without the other"):
        WebSettings(tls_certificate="chain.pem")
    with pytest.raises(InvalidArgument, match=r"missing\.pem is no file"):
        WebSettings(tls_certificate="missing.pem", tls_key="key.pem").checked_token()


def test_the_token_is_no_setting(monkeypatch):
    import attrs

    monkeypatch.setenv("MEMO_WEB_TOKEN", TOKEN)
    assert TOKEN not in str(attrs.asdict(WebSettings()))
