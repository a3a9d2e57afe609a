"""Torques held between instants: conversion of the given torques, limits, writing into input signals, and log."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from paraflex.actuation import FeedForward
from paraflex.arrays import Array
from paraflex.dynamics import InputSignals, State, System, constant_signals, pack_signals
from paraflex.errors import InputError
from paraflex.kernel.packed import Signals
from paraflex.mechanism import Mechanism
from paraflex.mechanism.quantities import all_known
from paraflex.tracking import path_stops
from .amplifiers import Amplifiers, padded_signal, relaxing
from .runs import TorqueLog
from .together import real_numbers

Torques = Sequence[float] | Mapping[str, float] | Array


class HeldTorques:
    """Held torques of a mechanism's motors behind their amplifiers, in addition to planned torques.

    Parameters
    ----------
    system : System
        Equations of motion of the mechanism.
    mechanism : Mechanism
        Mechanism as described.
    motors : tuple of str
        Motors whose torques are set, in the order of the mechanism.
    planned : FeedForward
        Planned torques of all motors; without signals none act.
    start, end : float
        Start and end time of the run [s].

    Attributes
    ----------
    planned : FeedForward
        Planned torques, with signals of zero torque if there are none.
    signals : kernel signals
        Input signals that the integration reads.
    knots : (k,) array
        Times at which the signals are not smooth [s].
    amplifiers : Amplifiers
        Limits and lags of the motors' amplifiers.
    limited : (motors,) array of bool
        Whether an amplifier limits the torques that are set.
    base : (pieces,) array
        Planned torques at the starts of the signals' pieces [N m, N].
    held : (motors,) array
        Held torques of all motors [N m, N].
    log : TorqueLog
        Log of the commanded torques.
    """

    def __init__(
        self, system: System, mechanism: Mechanism, motors: tuple[str, ...], planned: FeedForward, start: float,
        end: float,
    ) -> None:  # fmt: skip
        own = [motor.name for motor in mechanism.motors]
        self.motors: tuple[str, ...] = motors
        self._system = system
        self._active = [own.index(name) for name in motors]
        self.amplifiers: Amplifiers = Amplifiers(mechanism)
        self.limited: np.ndarray = self.amplifiers.limited & np.isin(np.arange(len(own)), self._active)
        known_signals = planned.signals or tuple(constant_signals([0.0] * len(own), end))
        self.planned: FeedForward = replace(planned, signals=known_signals)
        lags = self.amplifiers.lags
        several: list[InputSignals] = [
            padded_signal(each) if lag else each for each, lag in zip(known_signals, lags, strict=True)
        ]
        signals, knots = pack_signals(system.mechanism, several, end)
        self.signals: Signals = signals
        self.knots: Array = np.sort(np.concatenate([path_stops(planned.knots, mechanism), knots]))
        # Held torques are added to the constant coefficients of the signals.
        self.base: Array = self.signals.coefficients[:, 0].copy()
        self.held: Array = np.zeros(len(own))
        self.log: TorqueLog = TorqueLog(lags, start, self.held)

    def of_motors(self, torques: Torques) -> Array:
        """Return the torques of all motors (all,) from those of `motors`, or from values by name.

        Raises
        ------
        InputError
            Unknown motors, a wrong number of torques, or torques that are not finite.
        """
        if isinstance(torques, Mapping):
            all_known(torques, self.motors, "torques", "motor")
            torques = [torques.get(name, 0.0) for name in self.motors]
        given = real_numbers(torques)
        if given is None or given.shape != (len(self.motors),) or not np.isfinite(given).all():
            raise InputError(f"not {len(self.motors)} finite numbers", field="torques", value=torques,
                             remedy=f"give one each of {', '.join(self.motors)}")  # fmt: skip
        return self.of_all(given)

    def of_all(self, torques: Array) -> Array:
        """Return the torques of all motors (all,) from those of `motors`; zero for others."""
        everything = np.zeros(len(self.held))
        everything[self._active] = torques
        return everything

    def planned_at(self, t: float) -> Array:
        """Return the planned torques (all,) at a time [s]; zero without a plan."""
        return self.planned.evaluate(np.array([t]))[0]

    def acting(self, t: float) -> Array:
        """Return the torques (all,) that act at the time reached [s], planned torques included."""
        return self.log.now(t) + self.planned_at(t)

    def hold(self, torques: Array, t: float, state: Callable[[], State]) -> bool:
        """Hold torques (all,) from a time on [s], within the limits of amplifiers; return whether any changes."""
        if self.limited.any():
            torques = self._within_limits(torques, state())
        changed = not np.array_equal(torques, self.held)
        if changed or not len(self.log):
            self.note(t, torques)
        if changed:
            self._write()
        return changed

    def begin(self, torques: Array, state: State) -> None:
        """Hold torques (all,) from before the start on, within the limits of amplifiers."""
        self.held = self._within_limits(torques, state)
        self.log = TorqueLog(self.amplifiers.lags, state.time, self.held)
        self._write()

    def note(self, t: float, torques: Array) -> None:
        """Log torques (all,) that act from a time on [s]."""
        self.log.note(t, torques)
        self.held = torques

    def saved(self) -> tuple[Array, TorqueLog]:
        """Return the held torques (motors,) and a copy of the log, for `restore`."""
        return self.held.copy(), self.log.copy()

    def restore(self, saved: tuple[Array, TorqueLog]) -> None:
        """Return to a state that `saved` returned."""
        self.held, self.log = saved[0].copy(), saved[1].copy()
        self._write()

    def _within_limits(self, torques: Array, now: State) -> Array:
        """Return torques (all,) whose sum with the planned ones is within the amplifiers' limits at this speed."""
        low, high = self.amplifiers.limits(self.amplifiers.rates(self._system, now.q, now.v))
        planned = self.planned_at(now.time)
        return np.where(self.limited, np.clip(torques, low - planned, high - planned), torques)

    def _write(self) -> None:
        """Write the held torques into the signals."""
        breaks, coefficients, start = self.signals.breaks, self.signals.coefficients, self.signals.start
        since, begun, commanded = self.log.last
        for k, lag in enumerate(self.amplifiers.lags):
            pieces = slice(start[k], start[k + 1] - 1)
            if not lag:
                coefficients[pieces, 0] = self.base[pieces] + commanded[k]
                continue
            signal = relaxing(self.planned.signals[k], since, begun[k], commanded[k], lag)
            whole = padded_signal(signal, pieces.stop - pieces.start)
            breaks[pieces], coefficients[pieces] = whole.breaks[:-1], whole.coefficients
