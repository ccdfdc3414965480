"""The run of emcee: warm-up, steps that count, and when to stop.

How many steps are made, when the proposals are set and when the chain is looked at depends on
step numbers only, never on the clock: the same seed and device give the same chain, and a run
that was ended goes on as if it had not been.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from emcee import EnsembleSampler
from emcee.state import State
from numpy.typing import NDArray

from lobefit.fitting.chain_file import ChainFile
from lobefit.fitting.chains import autocorrelation_time, r_hat
from lobefit.fitting.laplace import Laplace
from lobefit.fitting.moves import EnsembleMove, Proposal
from lobefit.kernels import FitError

__all__ = [
    "Judgement",
    "Outcome",
    "SamplingProgress",
    "autocorrelation_times",
    "judge",
    "run",
    "warm_up_stages",
]

Array = NDArray[np.float64]

# Chains are long enough at so many autocorrelation times (emcee's documentation) ...
TIMES = 50.0
# ... whose estimate has changed by less than this share since the look before ...
STABLE = 0.1
# ... and with the ensembles agreeing to this R-hat (Vehtari et al. 2021).
R_HAT = 1.01
FIRST_LOOK = 100
GROWTH = 1.25


@dataclass(frozen=True, slots=True, kw_only=True)
class SamplingProgress:
    """Where a run stands.

    Attributes
    ----------
    steps, max_steps : int
        Made so far, warm-up included, and the budget.
    tau : float
        The longest autocorrelation time in steps, from the last look; NaN before the first.
    acceptance : float
        Share of accepted moves so far.
    ess : float
        Effective samples so far: steps that count times walkers over tau.
    seconds : float
        Since the run began or went on.
    seconds_left : float
        Until tau says that the chain is long enough, or the budget ends; NaN before the first look.
    """

    steps: int
    max_steps: int
    tau: float
    acceptance: float
    ess: float
    seconds: float
    seconds_left: float


@dataclass(frozen=True, slots=True)
class Judgement:
    """What a look at the chain says.

    Attributes
    ----------
    tau : ndarray, shape (n,)
        Autocorrelation times in steps.
    r_hat : ndarray, shape (n,)
    reasons : tuple of str
        Why the chain is not good yet, in words; none where it is.
    """

    tau: Array
    r_hat: Array
    reasons: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Outcome:
    """A finished run.

    Attributes
    ----------
    warm_up : int
        Steps that do not count.
    judgement : Judgement
        Of the steps that count.
    acceptance : float
        Of the steps that were made in this run, or of all.
    by_clock : bool
        Ended by a limit of seconds, which another machine would reach elsewhere.
    seconds : float
    """

    warm_up: int
    judgement: Judgement
    acceptance: float
    by_clock: bool
    seconds: float


def warm_up_stages(size: int) -> tuple[int, int, int]:
    """Give the steps at which the proposals are set anew; steps count after the last."""
    first = 40 + 8 * size
    return first, 2 * first, 4 * first


def _looks(first: int) -> Iterator[int]:
    """Give the numbers of counted steps at which the chain is looked at."""
    look = first
    while True:
        yield look
        look = int(look * GROWTH)


def autocorrelation_times(chain: Array) -> Array:
    """Give the autocorrelation time of each coordinate of a chain (steps, E, W, n), shape (n,)."""
    return np.array([autocorrelation_time(chain[..., k]) for k in range(chain.shape[-1])])


def judge(chain: Array, before: Array | None, labels: tuple[str, ...]) -> Judgement:
    """Tell whether a chain is long enough and mixed.

    Parameters
    ----------
    chain : ndarray, shape (steps, E, W, n)
        Steps that count.
    before : ndarray, shape (n,), or None
        The autocorrelation times at the look before, for whether they are stable.
    labels : tuple of str
        Names of the coordinates.
    """
    steps, ensembles, _, size = chain.shape
    tau = autocorrelation_times(chain)
    thin = max(1, int(np.nanmin(np.append(tau, steps))) // 2)
    thinned = chain[::thin].transpose(3, 1, 0, 2).reshape(size, ensembles, -1)
    hats = np.array([r_hat(x) for x in thinned])
    reasons = []
    still = [labels[k] for k in np.flatnonzero(~np.isfinite(tau))]
    if still:
        reasons.append(f"the walkers do not move in {', '.join(still)}")
    longest = int(np.nanargmax(np.append(tau, 0.0)))
    if longest < size and steps <= TIMES * tau[longest]:
        reasons.append(
            f"{steps} steps are fewer than {TIMES:.0f} autocorrelation times "
            f"({tau[longest]:.0f} steps for {labels[longest]})"
        )
    if before is not None:
        with np.errstate(invalid="ignore"):
            change = np.abs(tau - before) / tau
        k = int(np.nanargmax(np.append(change, 0.0)))
        if k < size and change[k] > STABLE:
            reasons.append(
                f"the autocorrelation time of {labels[k]} still changes, "
                f"from {before[k]:.1f} to {tau[k]:.1f} steps"
            )
    else:
        reasons.append("too few steps to tell whether the autocorrelation time is stable")
    k = int(np.nanargmax(np.append(hats, 0.0)))
    if k < size and hats[k] >= R_HAT:
        reasons.append(
            f"the {ensembles} ensembles disagree: R-hat of {labels[k]} is {hats[k]:.3f}, "
            f"not below {R_HAT}"
        )
    return Judgement(tau, hats, tuple(reasons))


def run(
    density: Callable[[Array], Array],
    approximation: Laplace,
    start: Callable[[np.random.RandomState], tuple[Array, Array]],
    chain: ChainFile,
    *,
    shape: tuple[int, int],
    seed: int,
    labels: tuple[str, ...],
    max_steps: int,
    max_seconds: float | None = None,
    until: int | None = None,
    progress: Callable[[SamplingProgress], None] | None = None,
) -> Outcome:
    """Sample until the chain is good or the budget ends.

    Parameters
    ----------
    density : callable
        Log-probabilities (W,) of points (W, n).
    approximation : Laplace
        For the first independent proposals.
    start : callable
        Draws the first walkers (E, W, n) and their log-probabilities.
    chain : ChainFile
        Where steps go; steps that are there already are not made again.
    shape : (int, int)
        Ensembles, walkers in each.
    seed : int
        Of the random numbers.
    labels : tuple of str
        Names of the coordinates.
    max_steps : int
        Budget, warm-up included.
    max_seconds : float, optional
        Another budget, which makes the result depend on the machine.
    until : int, optional
        Stop after so many counted steps without asking whether they are enough.
    progress : callable, optional
        Called a few times a second.

    Returns
    -------
    Outcome
    """
    began = time.perf_counter()
    walkers, size = shape[0] * shape[1], len(approximation.mode)
    move = EnsembleMove(shape[0], Proposal.normal(approximation.mode, 1.3 * approximation.root))
    random = np.random.RandomState(seed)
    if chain.iteration:
        state = chain.get_last_sample()
    else:
        points, values = start(random)
        state = State(
            points.reshape(walkers, size), values.ravel(), random_state=random.get_state()
        )
    sampler = EnsembleSampler(walkers, size, density, moves=[move], vectorize=True, backend=chain)
    sampler.log_prob_fn = density  # emcee's wrapper prints every error, Ctrl-C too
    made_before = chain.iteration
    stages = warm_up_stages(size)
    warm_up = stages[-1]
    told = _Teller(progress, max_steps, shape, warm_up, began, made_before)

    def counted(end: int) -> Array:
        return np.asarray(chain.chain[warm_up:end].reshape(-1, *shape, size))

    def advance(to: int) -> bool:
        """Make steps up to a number; False where the clock says to stop."""
        nonlocal state
        ahead = to - chain.iteration
        if ahead <= 0:
            return True
        # emcee hands the state on to the step after, so the last one goes on.
        for made in sampler.sample(state, iterations=ahead, skip_initial_state_check=True):
            state = made
            told(chain)
            if max_seconds is not None and time.perf_counter() - began > max_seconds:
                return False
        return True

    judgement, before, in_time = None, None, True
    try:
        for begin, stage in pairwise((0, *stages)):
            in_time = in_time and advance(min(stage, max_steps))
            if chain.iteration >= stage:
                seen = chain.chain[(begin + stage) // 2 : stage].reshape(-1, *shape, size)
                move.proposal = Proposal.of(seen)
        if not in_time or chain.iteration < warm_up or max_steps <= warm_up:
            raise FitError(
                f"the budget ended after {chain.iteration} steps, within the warm-up of {warm_up}; "
                "give more steps or seconds"
            )
        looked = 0
        for look in _looks(FIRST_LOOK) if until is None else (until,):
            end = min(warm_up + look, max_steps)
            if end < chain.iteration and until is None:
                looked = end  # the run that went on from there found it too short
                continue
            if looked:
                before, looked = autocorrelation_times(counted(looked)), 0
            in_time = advance(end)
            end = min(end, chain.iteration)
            judgement = judge(counted(end), before, labels)
            told.look(judgement, end)
            if not judgement.reasons or not in_time or end >= max_steps:
                break
            before = judgement.tau
    finally:
        chain.sync()
    assert judgement is not None
    chain.trim()
    return Outcome(
        warm_up=warm_up,
        judgement=judgement,
        acceptance=float(np.mean(chain.accepted) / max(chain.iteration, 1)),
        by_clock=not in_time,
        seconds=time.perf_counter() - began,
    )


class _Teller:
    """Tells the progress, a few times a second."""

    def __init__(
        self,
        progress: Callable[[SamplingProgress], None] | None,
        max_steps: int,
        shape: tuple[int, int],
        warm_up: int,
        began: float,
        made_before: int,
    ) -> None:
        self._progress, self._max, self._walkers = progress, max_steps, shape[0] * shape[1]
        self._warm_up, self._began, self._before = warm_up, began, made_before
        self._tau, self._last = float("nan"), 0.0

    def look(self, judgement: Judgement, end: int) -> None:
        """Note the autocorrelation time."""
        self._tau = float(np.nanmax(np.append(judgement.tau, np.nan if end < 2 else 1.0)))

    def __call__(self, chain: ChainFile) -> None:
        """Tell, unless it was told just now."""
        if self._progress is None:
            return
        now = time.perf_counter()
        if now - self._last < 0.2:
            return
        self._last = now
        steps, seconds = chain.iteration, now - self._began
        counts = max(steps - self._warm_up, 0)
        goal = min(self._warm_up + 1.1 * TIMES * self._tau, self._max)
        pace = seconds / max(steps - self._before, 1)
        self._progress(
            SamplingProgress(
                steps=steps,
                max_steps=self._max,
                tau=self._tau,
                acceptance=float(np.mean(chain.accepted) / steps),
                ess=counts * self._walkers / self._tau,
                seconds=seconds,
                seconds_left=max(goal - steps, 0.0) * pace,
            )
        )
