"""The Python client as people use it, against a service in memory and a network that fails."""

from __future__ import annotations

import gzip
import inspect
import io
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx2
import numpy as np
import pytest

from lobefit.fitting import Measurement
from lobefit.kernels import FitError, MeasurementError, ModelError
from lobefit.service import AsyncClient, Client, ServiceError
from lobefit.service.client import Batch, Chart, Fit
from tests.service.clients import CSV, blocking
from tests.service.fake_network import problem
from tests.service.fake_service import FakeService


def test_from_a_file_to_the_report(client: Any, service: FakeService, tmp_path: Path) -> None:
    path = tmp_path / "paint.csv"
    path.write_bytes(CSV)
    seen: list[Fit] = []
    fit = client.fit(path, "ggx", name="paint", posterior=True, wait=True, progress=seen.append)
    assert fit.state == "done" and fit.best == "ggx"
    assert [f.progress.done for f in seen if f.progress] == [1, 2, 3, 4]
    assert service.fits[fit.id]["request"]["models"] == ["ggx"]
    assert service.fits[fit.id]["request"]["posterior"] == {}
    (measurement,) = service.measurements.values()
    assert measurement["name"] == "paint.csv"
    report = client.result(fit)
    assert report.verdict == "ggx describes this surface to within its noise."
    assert report.best.params == {"k_d": [0.1], "alpha": 0.3}
    assert report["beckmann"].rank == 2
    assert str(report.best).splitlines()[1:] == ["  alpha = 0.3 ± 0.01"]
    assert report.posterior["converged"] is True
    assert "2  beckmann" in str(report)
    assert client.status(fit).ended.year == 2026


def test_every_kind_of_source_is_one_measurement(
    client: Any, service: FakeService, tmp_path: Path
) -> None:
    path = tmp_path / "x.csv.gz"
    path.write_bytes(gzip.compress(CSV))
    file = io.BytesIO(CSV)
    found = {client.upload(s).id for s in (CSV, path, str(path), file, io.StringIO(CSV.decode()))}
    assert len(found) == 1 and set(service.measurements) == found
    (id,) = found
    assert client.measurement(id).directions == 2
    assert client.measurement(id) == client.upload(path)
    angle = np.array([0.1, 0.2])
    m = Measurement(angle, angle, angle, angle, np.array([[1.0, 2.0]]), ("R",), source="mine")
    assert client.upload(m).name == "mine"
    assert [s.name for s in client.measurements()] == ["unnamed", "mine"]
    assert len(client.measurements(limit=1)) == 1


def test_checks_of_what_is_stored_and_what_is_not(client: Any, service: FakeService) -> None:
    checks = client.check(CSV)
    assert checks["peak"].figures == {"theta_deg": 1.5}
    assert [c.remedy for c in checks.suspicious] == ["Turn it."]
    (id,) = service.measurements
    assert client.check(id) == checks == client.check(client.measurement(id))


def test_errors_are_those_of_the_local_api(client: Any, tmp_path: Path) -> None:
    with pytest.raises(MeasurementError) as caught:
        client.upload(b"bad")
    e = caught.value
    assert (e.file, e.row, e.column, e.text, e.expected) == ("x.csv", 3, "R", "bad", "a number")
    assert str(e) == "x.csv, line 3, column R: 'bad' is not a number (expected a number)"
    with pytest.raises(MeasurementError, match=r"nothing\.csv: there is no such file"):
        client.fit(tmp_path / "nothing.csv")
    with pytest.raises(ModelError, match="there is no model 'no_such'"):
        client.fit(CSV, ["no_such"])
    with pytest.raises(FitError, match="no candidate could be fitted") as failed:
        client.fit(CSV, name="bad", wait=True)
    assert failed.value.__notes__ == ["fit fit-1 failed in the service"]
    with pytest.raises(FitError, match="no candidate could be fitted"):
        client.result("fit-1")
    with pytest.raises(FitError, match=r"is running; wait\(fit\) returns when"):
        client.result(client.fit(CSV))
    with pytest.raises(ServiceError, match=r"no such fit \(HTTP 404, request request-7\)") as gone:
        client.wait("fit-9")
    assert (gone.value.status, gone.value.slug) == (404, "not-found")
    with pytest.raises(ModelError, match="not finite"):
        client.evaluate("ggx", {"k_d": np.nan}, theta_i_deg=0, theta_o_deg=0, phi_o_deg=0)


def test_cancel_keeps_and_delete_removes(client: Any, service: FakeService) -> None:
    fit = client.fit(CSV)
    assert client.cancel(fit).state == "cancelled"
    assert client.cancel(fit).state == "cancelled" and fit.id in service.fits
    with pytest.raises(FitError, match="was cancelled before it had a result"):
        client.result(fit)
    client.delete(fit)
    running = client.fit(CSV)
    client.delete(running.id)
    assert service.fits == {}
    with pytest.raises(ServiceError, match="no such fit"):
        client.delete(fit)
    client.delete(client.measurements()[0])
    assert service.measurements == {}


def test_lists_go_over_all_pages(client: Any) -> None:
    made = [client.fit(CSV, name=f"fit {k}").id for k in range(5)]
    client.wait(made[0], progress=False)
    assert [f.id for f in client.fits()] == made
    assert [f.id for f in client.fits(3)] == made[:3]
    assert [f.id for f in client.fits(state="done")] == made[:1]


def test_values_of_a_model(client: Any, tmp_path: Path) -> None:
    values = client.evaluate(
        "ggx", {"k_d": np.float64(1)}, theta_i_deg=30, theta_o_deg=np.arange(3), phi_o_deg=[0, 1, 2]
    )
    assert values["R"] == (1.0, 2.0, 3.0)
    assert np.asarray(values).shape == (1, 3)
    angles = {"theta_i_deg": [0, 30], "theta_o_deg": [0, 1, 2], "phi_o_deg": [0]}
    assert np.asarray(client.evaluate_grid("ggx", {"k_d": 1}, **angles)).shape == (1, 2, 3, 1)
    path = client.evaluate_exr(tmp_path / "x.exr", "ggx", {"k_d": 1}, **angles)
    assert path.read_bytes().startswith(b"\x76\x2f\x31\x01")
    assert client.upload(client.simulate("ggx", {"k_d": 1}, seed=3)).directions == 2
    assert client.models()[0].title == "GGX"
    assert client.ready()


def test_other_refusals_are_not_tried_again(client: Any, service: FakeService) -> None:
    for status, slug in ((500, "internal"), (507, "storage-full"), (401, "unauthorized")):
        service.refusals = [problem(status, slug, "no")]
        with pytest.raises(ServiceError) as caught:
            client.models()
        assert (caught.value.status, caught.value.title) == (status, slug.title())
    service.refusals = [httpx2.Response(200, html="<p>a printer</p>")]
    with pytest.raises(ServiceError, match="not that of a Lobefit service"):
        client.models()


def test_the_token_is_sent_and_never_shown(service: FakeService) -> None:
    seen = []

    def handler(request: httpx2.Request) -> httpx2.Response:
        seen.append(request.headers.get("authorization"))
        return service(request)

    client = Client("https://lab.example/brdf/", "s3cret", transport=httpx2.MockTransport(handler))
    assert "s3cret" not in repr(client)
    with pytest.raises(ServiceError, match="there is nothing"):  # a path before ours is kept
        client.models()
    assert seen == ["Bearer s3cret"]
    with pytest.raises(ServiceError, match="the token"):
        Client(token="a\nb")
    for url in ("lab.example", "ftp://x", "http://", "http://[::1"):
        with pytest.raises(ServiceError, match="is no address"):
            Client(url)


def test_the_posterior_is_opened_with_arviz(client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    fit = client.fit(CSV, wait=True)
    monkeypatch.setitem(sys.modules, "arviz", None)
    with pytest.raises(ServiceError, match=r'pip install "lobefit\[arviz\]"'):
        client.posterior(fit)

    class Opened:
        def __init__(self, path: str) -> None:
            self.path = path

        def load(self) -> None:
            self.content = Path(self.path).read_bytes()

        def close(self) -> None:
            pass

    monkeypatch.setitem(sys.modules, "arviz", SimpleNamespace(from_netcdf=Opened))
    opened = client.posterior(fit)
    assert opened.content == b"netcdf"
    assert not Path(opened.path).exists()


def test_notebooks_show_tables_and_escape_texts(service: FakeService) -> None:
    client = blocking(httpx2.MockTransport(service))
    stored = client.upload(CSV, name="<script>")
    fit = client.fit(stored, name="<img>", wait=True)
    values = client.evaluate(
        "m", {"k_d": 1}, theta_i_deg=0, theta_o_deg=list(range(20)), phi_o_deg=0
    )
    shown: list[Any] = [stored, stored.checks, fit, client.result(fit), client.models()[0], values]
    for thing in shown:
        text = thing._repr_html_()
        assert text.count("<table>") == text.count("</table>") >= 1
        assert not any(tag in text for tag in ("<script>", "<img>", "<i>", "<b>alert"))
        assert len(repr(thing)) < 1000
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in client.result(fit)._repr_html_()
    assert "alpha" in client.result(fit)._repr_html_()
    with pytest.raises(AttributeError):
        stored.name = "other"  # type: ignore[misc]


def test_the_progress_is_a_line_on_a_terminal(
    service: FakeService, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    client = blocking(httpx2.MockTransport(service))
    client.fit(CSV, wait=True)
    assert capsys.readouterr() == ("", ""), "nobody watches"
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    client.fit(CSV, name="[red]x", wait=True)
    out, err = capsys.readouterr()
    assert out == ""
    assert "ggx" in err or "fit" in err


def test_methods_say_what_they_do() -> None:
    for kind in (Client, AsyncClient, Fit, Chart, Batch):
        for name in dir(kind):
            if not name.startswith("_") and callable(getattr(kind, name)):
                assert inspect.getdoc(getattr(kind, name)), name
    for kind in (Client, AsyncClient):
        assert list(inspect.signature(kind.upload).parameters) == ["self", "source", "name"]
        assert "Seconds without a byte" in (kind.__doc__ or "")
    assert inspect.iscoroutinefunction(AsyncClient.aclose)


def test_it_needs_neither_numpy_nor_opencl() -> None:
    script = """
import sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("numpy", "pyopencl", "emcee", "nlopt", "matplotlib", "h5py",
                                      "h5netcdf", "OpenEXR", "fastapi", "pydantic"):
            raise ImportError(name + " must not be imported here")
sys.meta_path.insert(0, Blocked())
import httpx2, json
from lobefit.service import AsyncClient, Client, ServiceError
from lobefit.kernels import MeasurementError
document = {"channels": ["R"], "values": [[1.0]], "shape": [1]}
transport = httpx2.MockTransport(lambda r: httpx2.Response(200, json=document))
with Client(transport=transport) as client:
    print(client.evaluate("ggx", {}, theta_i_deg=0, theta_o_deg=0, phi_o_deg=0))
    try:
        client.upload("/no/such/file.csv")
    except MeasurementError as error:
        print(error)
"""
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "Values(channels=('R',), shape=(1,))",
        "/no/such/file.csv: there is no such file",
    ]
