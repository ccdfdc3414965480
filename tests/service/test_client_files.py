"""What the client downloads: whole, checked, resumed, and only where it was asked to."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx2
import pytest

from lobefit.kernels import FitError, LobefitError
from lobefit.service import ServiceError
from lobefit.service.client import Retries
from tests.service.clients import CSV, blocking
from tests.service.fake_service import FakeService


def test_a_download_is_whole_or_not_there(
    client: Any, service: FakeService, tmp_path: Path
) -> None:
    fit = client.fit(CSV, wait=True)
    folder = tmp_path / "new" / "folder"
    found = client.download(fit, folder)
    assert {n: p.read_bytes() for n, p in found.items()} == service.files
    assert sorted(p.name for p in folder.iterdir()) == sorted(service.files)
    before = service.requests.copy()
    assert client.download(fit, folder, ["fit.png"]) == {"fit.png": folder / "fit.png"}
    asked = service.requests - before
    assert list(asked) == [f"GET /v1/fits/{fit.id}"], "what is there is not sent again"
    with pytest.raises(FitError, match=r"has no file 'x'; it has: report\.json, fit\.png"):
        client.download(fit, folder, ["x"])
    (folder / "taken").write_text("a file")
    with pytest.raises(LobefitError, match="taken cannot be written"):
        client.download(fit, folder / "taken")


def test_a_download_goes_on_where_another_stopped(
    client: Any, service: FakeService, tmp_path: Path
) -> None:
    fit = client.fit(CSV, wait=True)
    digest = next(a.sha256 for a in client.status(fit).artefacts if a.name == "fit.png")
    part = tmp_path / f".fit.png.{digest[:16]}.part"
    part.write_bytes(service.files["fit.png"][:60_000])
    client.download(fit, tmp_path, ["fit.png"])
    assert (tmp_path / "fit.png").read_bytes() == service.files["fit.png"]
    part.write_bytes(b"something else")
    (tmp_path / "fit.png").unlink()
    client.download(fit, tmp_path, ["fit.png"])
    assert (tmp_path / "fit.png").read_bytes() == service.files["fit.png"]
    assert not part.exists()


@pytest.mark.parametrize("name", ["../x", "/etc/x", "..", ".hidden", "a/b", "a\\b", "x\n"])
def test_no_file_is_written_outside_of_the_folder(
    service: FakeService, tmp_path: Path, name: str
) -> None:
    service.files[name] = b"x"
    client = blocking(httpx2.MockTransport(service))
    fit = client.fit(CSV, wait=True)
    with pytest.raises(ServiceError, match="which is not stored"):
        client.download(fit, tmp_path / "folder")
    assert list(tmp_path.iterdir()) == []


def test_what_is_not_what_was_promised_is_not_kept(service: FakeService, tmp_path: Path) -> None:
    client = blocking(httpx2.MockTransport(service), retries=Retries(attempts=2, first=1e-4))
    fit = client.fit(CSV, wait=True)
    honest = service.fit
    content = service.files["fit.png"]

    def lying(request: httpx2.Request, method: str, id: str, rest: list[str]) -> httpx2.Response:
        service.files["fit.png"] = b"y" * len(content) if rest else content
        return honest(request, method, id, rest)

    service.fit = lying  # type: ignore[method-assign]
    with pytest.raises(ServiceError, match=r"fit\.png as it arrived has another SHA-256"):
        client.download(fit, tmp_path, ["fit.png"])
    assert list(tmp_path.iterdir()) == []
