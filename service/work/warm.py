"""Opening the device and doing everything once, so that the first job is as fast as the next."""

from __future__ import annotations

from lobefit.kernels import get_device

__all__ = ["warm"]


def warm(kinds: tuple[str, ...]) -> str:
    """Open the device and compile what jobs of these kinds run; gives the device's name."""
    from lobefit.fitting import check, fit, simulate

    device = get_device()
    small = simulate(
        "ggx",
        {"k_d": [0.1, 0.2, 0.3], "alpha": 0.3},
        geometry="in-plane incidences=0,30,60 step=5",
        seed=1,
        device=device,
    )
    if "fit" in kinds:
        fit(small, device=device).to_dict()
    elif kinds:
        check(small, device=device)
    return str(device.info)
