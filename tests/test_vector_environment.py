"""Vector environments: bit for bit what Gymnasium makes of single ones, on any number of threads."""

import copy
import importlib
import pickle
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from test_simulation import rotor

gymnasium = pytest.importorskip("gymnasium")

MODES = ("NextStep", "SameStep", "Disabled")
# An event ends the episodes of rotors that are braked.
ENDING = pf.IntegrationOptions(events=[pf.JointLimit("hub", low=0.8)])


def turned(simulation, readings, action):
    """A reward for a rotor: minus its angle."""
    return -readings["hub"]


ROTOR = {"reward": turned, "limits": 60.0, "duration": 0.02, "sensors": ["hub", "rate"], "noise": {"rate": 0.1}}


def rotors(number=3, **more):
    return pf.VectorEnvironment(rotor(), number, **ROTOR | more)


def one_by_one(number=3, mode="NextStep", **more):
    """The same by Gymnasium, in one thread."""
    made = [lambda: pf.Environment(rotor(), **ROTOR | more)] * number
    return gymnasium.vector.SyncVectorEnv(made, autoreset_mode=mode)


def assert_same(one, other):
    """Equal types, shapes and bits, down to the infos of infos."""
    if isinstance(one, dict):
        assert set(one) == set(other)
        for name in one:
            assert_same(one[name], other[name])
    elif isinstance(one, tuple) or (isinstance(one, np.ndarray) and one.dtype == object):
        assert len(one) == len(other)
        for mine, its in zip(one, other, strict=True):
            assert_same(mine, its)
    elif isinstance(one, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        assert np.array_equal(one, other)
    else:
        assert one == other


def actions_of(envs, steps, scale=1.0, seed=5):
    return np.random.default_rng(seed).uniform(-scale, scale, (steps, *envs.action_space.shape))


def ended(result):
    return result[2] | result[3]


def assert_same_steps(envs, others, actions, mode="NextStep", seed=11):
    """Compare the results of all steps; return how many episodes were terminated, and truncated."""
    assert_same(envs.reset(seed=seed), others.reset(seed=seed))
    counts = np.zeros(2, dtype=int)
    for given in actions:
        results = envs.step(given), others.step(given)
        assert_same(*results)
        counts += results[0][2].sum(), results[0][3].sum()
        if mode == "Disabled" and ended(results[0]).any():
            # Gymnasium takes the mask out of the options.
            assert_same(*(each.reset(options={"reset_mask": ended(results[0])}) for each in (envs, others)))
    return counts


# --- The same as one at a time ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("mode", MODES)
def test_episodes_are_those_of_single_environments(mode, threads):
    """Some episodes are terminated by an event and others end, at different steps."""
    envs = rotors(4, options=ENDING, threads=threads, autoreset_mode=mode)
    actions = actions_of(envs, 60)
    actions[:, 0], actions[:, 1] = -0.8, 0.5
    counts = assert_same_steps(envs, one_by_one(4, mode, options=ENDING), actions, mode)
    assert np.all(counts > 2)
    envs.close()


@pytest.mark.parametrize("options", [None, pf.IntegrationOptions(method="generalised-alpha", step=2.5e-4)])
def test_flexible_mechanisms_are_the_same_on_threads(options):
    robot = pf.load("raparm_i")
    task = pf.plan(robot.mechanism, robot.paths["square"], duration=0.01, samples=11)
    settings = {"mode": "++++", "options": options, "noise": {"x": 1e-5}, "ahead": (0.005,)}
    made = gymnasium.vector.SyncVectorEnv([lambda: pf.Environment(task, **settings)] * 3)
    envs = pf.VectorEnvironment(task, 3, threads=2, **settings)
    assert_same_steps(envs, made, actions_of(envs, 25))
    for mine, its in zip(envs.envs, made.envs, strict=True):
        assert np.array_equal(mine.simulation.result().solution.q, its.unwrapped.simulation.result().solution.q)


def test_what_diverges_does_not_affect_the_others():
    robot = pf.load("raparm_i")
    task = pf.plan(robot.mechanism, robot.paths["square"], duration=0.04, samples=41)
    coarse = pf.IntegrationOptions(method="tr-bdf2", step=1e-3, constraints="baumgarte")
    settings = {"mode": "++++", "limits": 50.0, "options": coarse}
    made = gymnasium.vector.SyncVectorEnv([lambda: pf.Environment(task, **settings)] * 2)
    envs = pf.VectorEnvironment(task, 2, threads=2, **settings)
    # Motors against one another in the first, as in the test of one environment.
    actions = np.zeros((41, 2, 4))
    actions[::2, 0], actions[1::2, 0] = [1.0, -1.0, 1.0, -1.0], [-1.0, 1.0, -1.0, 1.0]
    terminated, truncated = assert_same_steps(envs, made, actions)
    assert terminated >= 1
    assert truncated == 1


def test_mechanisms_vary_by_the_seeds_of_the_environments():
    (body,) = rotor().mechanism.bodies

    def heavier(random):
        return replace(rotor().mechanism, bodies=(replace(body, inertia=random.uniform(0.01, 0.05)),))

    envs, others = rotors(2, threads=2, vary=heavier), one_by_one(2, vary=heavier)
    assert_same_steps(envs, others, actions_of(envs, 45))
    turning = [each.simulation.mechanism.bodies[0].inertia for each in envs.envs]
    assert turning[0] != turning[1]


# --- What Gymnasium asks for ------------------------------------------------------------------------------------------


def test_it_is_made_by_name():
    assert pf.Environment  # registers it
    envs = gymnasium.make_vec("paraflex/RAParM-I-v0", 2, mode="++++", threads=2, autoreset_mode="SameStep")
    assert isinstance(envs, pf.VectorEnvironment)
    assert envs.spec.id == "paraflex/RAParM-I-v0"
    assert envs.metadata["autoreset_mode"] is gymnasium.vector.AutoresetMode.SAME_STEP
    assert (envs.num_envs, envs.single_action_space.shape, envs.action_space.shape) == (2, (4,), (2, 4))
    seen, _ = envs.reset(seed=0)
    assert seen in envs.observation_space
    single = gymnasium.make("paraflex/RAParM-I-v0", mode="++++")
    assert np.array_equal(seen[1], single.reset(seed=1)[0])
    assert single.unwrapped.observation_space == envs.single_observation_space
    assert pf.library.environments("five_bar", 2).num_envs == 2


@pytest.mark.parametrize("mode", MODES[:2])
def test_wrappers_find_the_same(mode):
    wrap = gymnasium.wrappers.vector.RecordEpisodeStatistics
    envs, others = wrap(rotors(autoreset_mode=mode)), wrap(one_by_one(mode=mode))
    for each in (envs, others):
        each.reset(seed=0)
    found = []
    for given in actions_of(envs, 45):
        results = [each.step(given) for each in (envs, others)]
        for *_, infos in results:
            (infos.get("episode") or {}).pop("t", None)
        assert_same(*results)
        found += [results[0][4]["episode"]["r"]] if "episode" in results[0][4] else []
    assert len(found) == 2


def test_generators_are_those_of_the_environments():
    envs = rotors(2)
    envs.reset(seed=3)
    assert envs.np_random_seed == (3, 4)
    assert [each is one.np_random for each, one in zip(envs.np_random, envs.envs, strict=True)] == [True, True]


def test_without_gymnasium_the_extra_is_named(monkeypatch):
    for name in ("gymnasium", "gymnasium.vector"):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, "paraflex.control.vector_environment")
    without = importlib.import_module("paraflex.control.vector_environment")
    with pytest.raises(pf.InputError, match=r"VectorEnvironment: .* Gymnasium, .*; pip install 'paraflex\[gym\]'"):
        without.VectorEnvironment(rotor(), 2, **ROTOR)


# --- Seeds and resets -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [7, [7, 8, 9], (7, 8, 9), [7, None, 9]])
def test_seeds_are_one_or_one_each(seed):
    envs, others = rotors(), rotors()
    seen, expected = envs.reset(seed=seed)[0], others.reset(seed=7)[0]
    known = [k for k in range(3) if not isinstance(seed, list) or seed[k] is not None]
    assert np.array_equal(seen[known], expected[known])
    assert not np.array_equal(*envs.reset()[0][:2])


@pytest.mark.parametrize("seed", [-1, "abc", [1, 2], [1, 2, -3], [1, 2, 3.0]])
def test_bad_seeds_are_refused_as_by_gymnasium(seed):
    envs = rotors()
    for each in (envs, one_by_one()):
        with pytest.raises((ValueError, gymnasium.error.Error)):
            each.reset(seed=seed)
    assert_same_steps(envs, one_by_one(), actions_of(envs, 2))


def test_options_other_than_a_mask_are_refused():
    with pytest.raises(pf.InputError, match="options: there are none"):
        rotors().reset(options={"saved": 1})


def test_with_autoreset_disabled_ended_episodes_need_a_reset():
    envs = rotors(autoreset_mode="Disabled", duration=2e-3)
    mask, zero = np.array([True, False, True]), np.zeros((3, 1))
    with pytest.raises(gymnasium.error.ResetNeeded, match="has ended, or not begun"):
        envs.step(zero)
    envs.reset()
    for which in (mask, ~mask):
        for _ in range(2):
            envs.step(zero)
        for _ in range(2):
            with pytest.raises(gymnasium.error.ResetNeeded, match="has ended, or not begun"):
                envs.step(zero)
        envs.reset(options={"reset_mask": which})
        with pytest.raises(gymnasium.error.ResetNeeded, match="has ended, or not begun"):
            envs.step(zero)
        _, infos = envs.reset(options={"reset_mask": ~which})
        assert list(infos["_time"]) == (~which).tolist()


# --- Bad input --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "actions",
    [np.zeros((2, 1)), np.zeros((3, 2)), np.zeros(3), [[0.0], [np.nan], [0.0]], [[np.inf]] * 3, [[1j]] * 3, None, "a"],
)
def test_bad_actions_advance_nothing(actions):
    envs, others = rotors(threads=2), rotors(threads=1)
    for each in (envs, others):
        each.reset(seed=0)
    with pytest.raises(pf.InputError, match=r"actions: not 3 x 1 finite numbers.*from -1 to 1 for each of"):
        envs.step(actions)
    assert_same(envs.step(np.ones((3, 1))), others.step(np.ones((3, 1))))


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"number": 0}, "num_envs: must be positive"),
        ({"number": -3}, "num_envs: must be positive"),
        ({"number": 2.5}, "num_envs"),
        ({"number": "two"}, "num_envs"),
        ({"number": 10**9}, "num_envs: too many.*at most 1 024"),
        ({"threads": 0}, "threads: must be positive"),
        ({"threads": 1.5}, "threads"),
        ({"autoreset_mode": "Never"}, "autoreset_mode: unknown autoreset mode"),
        ({"autoreset_mode": None}, "autoreset_mode: unknown autoreset mode"),
        ({"limits": -1.0}, r"limits.*: must be positive"),
    ],
)
def test_bad_environments(more, said):
    with pytest.raises(pf.InputError, match=said):
        rotors(**more)


# --- Errors, threads, ends --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("error", [KeyboardInterrupt, ZeroDivisionError])
@pytest.mark.parametrize("where", ["simulate_period", "step"])
def test_after_an_error_in_a_step_all_have_to_be_reset(threads, error, where, monkeypatch):
    envs, others = rotors(threads=threads), rotors(threads=threads)
    envs.reset(seed=0)
    envs.step(np.zeros((3, 1)))

    def broken(*_):
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(envs.envs[1], where, broken)
        with pytest.raises(error):
            envs.step(np.zeros((3, 1)))
    with pytest.raises(gymnasium.error.ResetNeeded):
        envs.step(np.zeros((3, 1)))
    assert_same_steps(envs, others, actions_of(envs, 25))


def test_a_reward_may_not_step_the_environments():
    def nested(simulation, readings, action):
        return envs.step(np.zeros((2, 1)))[1][0]

    envs = rotors(2, reward=nested, threads=2)
    envs.reset(seed=0)
    with pytest.raises(pf.InputError, match="environment: is running"):
        envs.step(np.zeros((2, 1)))


def test_closed_environments():
    before, envs = set(threading.enumerate()), rotors(threads=2)
    envs.reset(seed=0)
    envs.step(np.zeros((3, 1)))
    (own,) = set(threading.enumerate()) - before
    assert own.name.startswith("paraflex-environments")
    envs.close()
    envs.close()
    assert envs.closed
    assert not own.is_alive()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError, match="closed"):
        envs.step(np.zeros((3, 1)))


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda envs: pickle.loads(pickle.dumps(envs))])
def test_copies_continue_to_the_bit(copied):
    envs = rotors(threads=2)
    envs.reset(seed=0)
    first, rest = np.split(actions_of(envs, 30), [8])
    for given in first:
        envs.step(given)
    other = copied(envs)
    for given in rest:
        assert_same(envs.step(given), other.step(given))


def test_several_step_at_once_on_other_threads():
    made = [rotors(threads=2) for _ in range(3)]
    actions, found = actions_of(made[0], 45), {}

    def play(k):
        made[k].reset(seed=0)
        found[k] = tuple(made[k].step(given) for given in actions)

    players = [threading.Thread(target=play, args=(k,)) for k in (0, 1)]
    for each in players:
        each.start()
    for each in players:
        each.join()
    play(2)
    assert_same(found[0], found[2])
    assert_same(found[1], found[2])
