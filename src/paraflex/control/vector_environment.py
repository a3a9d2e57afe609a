"""Gymnasium environments of several simulations at once, whose kernels run on threads."""

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from functools import partial
from typing import TYPE_CHECKING, Any

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Numbers
from paraflex.errors import as_enum
from paraflex.limits import ENVIRONMENTS, at_most
from paraflex.mechanism import Mechanism
from paraflex.mechanism.quantities import positive
from paraflex.paths import ModelWithPaths
from paraflex.tracking import TrackingTask
from .environment import Environment, within

if TYPE_CHECKING:
    from gymnasium.vector import SyncVectorEnv
else:
    try:
        from gymnasium.vector import SyncVectorEnv
    except ImportError:
        from .no_gymnasium import Env as SyncVectorEnv


class VectorEnvironment(SyncVectorEnv[Array, Numbers]):
    """Gymnasium's `SyncVectorEnv` of environments of one mechanism, with the same results, but kernels run on threads.

    Functions `reward` and `vary` do not. An episode that is terminated has no effect on the others.

    Parameters
    ----------
    source : TrackingTask, Mechanism or Model
        See `Environment`.
    num_envs : int
        Number of environments.
    threads : int, optional
        Number of threads; by default, that of processors.
    autoreset_mode : str or gymnasium.vector.AutoresetMode
        "NextStep": the step after the end of an episode ignores the action and begins another. "SameStep": the last
        step begins it. "Disabled": `reset` begins it, with options={"reset_mask": (num_envs,) array of bool}.
    **settings
        Further arguments of `Environment`.

    Raises
    ------
    InputError
        Gymnasium is not installed; numbers that are not positive; too many environments; an unknown mode; or arguments
        that `Environment` rejects.
    """

    envs: list[Environment]  # pyright: ignore[reportIncompatibleVariableOverride]

    @checked_arguments()
    def __init__(
        self, source: TrackingTask | Mechanism | ModelWithPaths, num_envs: int = 1, *, threads: int | None = None,
        autoreset_mode: Any = "NextStep", **settings: Any,
    ) -> None:  # fmt: skip
        from gymnasium.vector import AutoresetMode

        for name, number in (("num_envs", num_envs), ("threads", 1 if threads is None else threads)):
            positive(number, name, name)
        at_most(num_envs, ENVIRONMENTS, "num_envs")
        mode = as_enum(AutoresetMode, autoreset_mode, "autoreset_mode")
        super().__init__([partial(Environment, source, **settings)] * num_envs, autoreset_mode=mode)
        self._others = min(num_envs, threads or os.cpu_count() or 1) - 1
        self._pool: ThreadPoolExecutor | None = None

    def step(self, actions: Numbers) -> tuple[Array, Any, Any, Any, dict[str, Any]]:
        """Apply torques for one period: see `Environment.step`.

        After an error other than of the actions, KeyboardInterrupt for example, all environments have to be reset.

        Parameters
        ----------
        actions : (num_envs, motors) array
            Torques as fractions of the limits.

        Raises
        ------
        InputError
            Actions of another shape, or that are not finite; no environment has advanced then.
        gymnasium.error.ResetNeeded, gymnasium.error.ClosedEnvironmentError
            An episode has not begun, or has ended with autoreset disabled; the environments are closed.
        """
        from gymnasium.error import ClosedEnvironmentError, ResetNeeded

        if self.closed:
            raise ClosedEnvironmentError("the environments are closed; make others")
        given = within(actions, (self.num_envs, self.envs[0].limits.size), self.envs[0].motors, "actions")
        running = [(env, action) for env, action in zip(self.envs, given, strict=True) if env.running]
        if self.metadata["autoreset_mode"].value == "Disabled" and len(running) < self.num_envs:
            raise ResetNeeded("an episode has ended, or not begun; call reset()")
        try:
            for env, action in running:
                env.begin_period(action)
                env.begun = action
            self._simulate(iter([env for env, _ in running]))
            return super().step(given)
        except BaseException:
            for env in self.envs:
                env.running = False
            raise

    def close_extras(self, **_: Any) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes to be copied or pickled, without the threads."""
        return vars(self) | {"_pool": None}

    def _simulate(self, left: Iterator[Environment]) -> None:
        """Simulate the periods of environments, each on the thread that is free first."""

        def work() -> None:
            for env in left:
                env.simulate_period()

        if self._pool is None and self._others:
            self._pool = ThreadPoolExecutor(self._others, thread_name_prefix="paraflex-environments")
        others = [self._pool.submit(work) for _ in range(self._others)] if self._pool else []
        try:
            work()
        finally:
            # After an error no thread begins with another environment; one that has not begun has nothing left to do.
            list(left)
            others = [each for each in others if not each.cancel()]
            wait(others)
        for each in others:
            each.result()
