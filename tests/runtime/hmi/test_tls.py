"""The page over TLS, as another computer gets it."""

import json
import ssl
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from runtime.hmi.process import context, open_site
from runtime.hmi.web import Site
from specs.errors import InputError
from tests.runtime.modbus.certificates import Authority


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    certificate, key = Authority(tmp_path).give("controller")
    told = {"host": "127.0.0.1", "port": 0, "tls": {"certificate": str(certificate), "key": str(key)}}
    found = open_site(told, {("GET", "/api/catalogue"): lambda request: {"source": "here"}}, None)
    serving = threading.Thread(target=found.serve_forever, args=(0.1,), daemon=True)
    serving.start()
    yield found
    found.shutdown()
    found.server_close()


def ask(site: Site, context: ssl.SSLContext | None, scheme: str = "https") -> dict[str, str]:
    address = f"{scheme}://127.0.0.1:{site.port}/api/catalogue"
    with urllib.request.urlopen(address, timeout=10, context=context) as answer:
        return json.loads(answer.read())


def test_it_is_served_over_tls_and_not_in_plain_text(site: Site, tmp_path: Path) -> None:
    trusting = ssl.create_default_context(cafile=str(tmp_path / "authority.pem"))
    assert ask(site, trusting) == {"source": "here"}
    with pytest.raises(urllib.error.URLError, match="CERTIFICATE_VERIFY_FAILED"):
        ask(site, ssl.create_default_context())
    with pytest.raises(OSError):  # noqa: PT011  (closed or reset, as it comes)
        ask(site, None, "http")
    assert ask(site, trusting) == {"source": "here"}


def test_no_old_tls(tmp_path: Path) -> None:
    assert context(*Authority(tmp_path).give("controller")).minimum_version == ssl.TLSVersion.TLSv1_2


def test_files_that_are_no_certificate_are_refused_by_name(tmp_path: Path) -> None:
    certificate, _ = Authority(tmp_path).give("controller")
    told = {"host": "127.0.0.1", "port": 0, "tls": {"certificate": str(certificate), "key": str(certificate)}}
    with pytest.raises(InputError, match=r"hmi\.tls: .*controller\.pem"):
        open_site(told, {}, None)
