"""Environments of Gymnasium: its own checker, seeds, rewards and ends; the same runs as of simulations."""

import importlib
import sys
from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from paraflex import SampledController, Simulation
from test_simulation import rotor

gymnasium = pytest.importorskip("gymnasium")

ENCODERS = ("A1", "D1", "A2", "D2")


@pytest.fixture(scope="module")
def task():
    """A corner of RAParM-I's square."""
    robot = pf.load("raparm_i")
    return pf.plan(robot.mechanism, robot.paths["square"], duration=0.04, samples=41)


@pytest.fixture(scope="module")
def env(task):
    return pf.Environment(task, mode="++++", limits=4.0)


def turned(simulation, readings, action):
    """A reward for a rotor: minus its angle."""
    return -readings["hub"]


def of_rotor(**more):
    settings = {"reward": turned, "limits": 60.0, "duration": 0.02, "sensors": ["hub", "rate"]}
    return pf.Environment(rotor(), **settings | more)


def episode(env, seed=None, policy=None, most=10**6):
    """Observations, rewards and the last `info` of an episode, under a policy or actions of a generator."""
    random = np.random.default_rng(7)
    policy = policy or (lambda seen: random.uniform(-1.0, 1.0, env.action_space.shape))
    seen, info = env.reset(seed=seed)
    observations, rewards, ended = [seen], [], False
    while not ended and len(rewards) < most:
        seen, reward, terminated, truncated, info = env.step(policy(seen))
        observations.append(seen)
        rewards.append(reward)
        ended = terminated or truncated
    return np.array(observations), np.array(rewards), info


def still(env):
    return lambda seen: np.zeros(env.action_space.shape)


# --- What Gymnasium asks for ------------------------------------------------------------------------------------------


def test_gymnasium_finds_nothing_to_complain_about():
    from gymnasium.utils.env_checker import check_env

    assert pf.Environment  # registers it
    made = gymnasium.make("paraflex/RAParM-I-v0", noise={"x": 1e-5}, ahead=(0.01,))
    check_env(made.unwrapped)
    assert made.unwrapped.observed == (
        *made.unwrapped.observed[:6],
        *(f"{n}+0.01" for n in made.unwrapped.observed[:6]),
    )
    seen, _ = made.reset(seed=1)
    assert (seen.dtype, made.action_space.dtype) == (np.float64, np.float32)
    made.close()


def test_a_rotor_passes_as_well():
    from gymnasium.utils.env_checker import check_env

    check_env(of_rotor(), skip_render_check=True)


def test_names_of_a_module_work(task):
    made = gymnasium.make("paraflex.control.environment:paraflex/RAParM-I-v0")
    assert isinstance(made.unwrapped, pf.Environment)
    assert made.spec.max_episode_steps is None


def test_without_gymnasium_the_extra_is_named(task, monkeypatch):
    for name in ("gymnasium", "gymnasium.spaces"):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, "paraflex.control.environment")
    without = importlib.import_module("paraflex.control.environment")
    with pytest.raises(pf.InputError, match=r"Environment: .* Gymnasium, .*; pip install 'paraflex\[gym\]'"):
        without.Environment(task)


# --- Seeds ------------------------------------------------------------------------------------------------------------


def test_a_seed_is_an_episode_to_the_bit(task):
    noisy = pf.Environment(task, noise={"x": 1e-4, "A1": 1e-3}, quantise={"A2": 1e-5})
    first, others = episode(noisy, 3, most=12), [episode(noisy, seed, most=12) for seed in (3, 4)]
    for same, other in zip(first[:2], others[0][:2], strict=True):
        assert np.array_equal(same, other)
    assert not np.array_equal(first[0], others[1][0])
    # The motion is the same, and what bears no noise.
    apart = np.any(first[0] != others[1][0], axis=0)
    assert set(np.array(noisy.observed)[apart]) == {"x", "A1"}
    assert np.array_equal(first[1], others[1][1])


def test_noise_has_its_deviation_and_readings_their_resolution():
    env = of_rotor(
        sensors=["hub", "rate"], noise={"rate": 0.5}, quantise={"hub": 0.02}, scales={"rate": 10.0}, errors=False
    )
    observed = np.concatenate([episode(env, seed, still(env))[0] for seed in range(40)])
    assert np.std(10.0 * observed[:, 1]) == pytest.approx(0.5, rel=0.06)  # of 840 numbers, two deviations
    assert np.allclose(observed[:, 0], 1.0, atol=1e-12)
    assert not np.array_equal(env.reset()[0], env.reset()[0])


def test_mechanisms_vary(task):
    def loaded(random):
        return task.mechanism.with_payload(pf.Payload(random.uniform(0.1, 0.5)))

    varied, alone = pf.Environment(task, vary=loaded), pf.Environment(task)
    ends = [episode(varied, seed, still(varied), most=20)[0][-1] for seed in (1, 1, 2)]
    assert np.array_equal(ends[0], ends[1])
    assert not np.allclose(ends[0], ends[2], rtol=1e-3)
    random = np.random.default_rng(1)
    by_hand = pf.Environment(task.remodelled(loaded(random)), limits=1.0)
    assert np.array_equal(episode(by_hand, 0, still(by_hand), most=20)[0][-1], ends[0])
    assert not np.allclose(episode(alone, 0, still(alone), most=20)[0][-1], ends[0], rtol=1e-3)


def test_a_start_and_a_duration_stay_where_mechanisms_vary():
    def heavier(random):
        (body,) = rotor().mechanism.bodies
        return replace(rotor().mechanism, bodies=(replace(body, inertia=0.02),))

    varied, alone = (of_rotor(vary=vary) for vary in (heavier, None))
    seen, *_ = episode(varied, 0, lambda seen: [0.5])
    half, *_ = episode(alone, 0, lambda seen: [0.25])
    assert seen == pytest.approx(half, abs=1e-9)
    assert seen[0, 0] == 1.0


def test_a_mechanism_of_other_members_is_refused(task):
    env = pf.Environment(task, vary=lambda random: pf.load("five_bar").mechanism)
    with pytest.raises(pf.InputError, match="vary: makes a mechanism with other members"):
        env.reset(seed=0)


# --- The same runs as of simulations ----------------------------------------------------------------------------------


def test_without_actions_it_is_the_open_loop_run(task):
    tight = pf.IntegrationOptions(method="esdirk4", tolerance=1e-7)
    env = pf.Environment(task, mode="++++", options=tight)
    observed, rewards, info = episode(env, 0, still(env))
    driven = pf.simulate(task, "++++", options=tight).driven
    deviations = driven.actual - driven.desired
    assert observed[:, 4:] == pytest.approx(deviations, abs=2e-7)
    squares = np.sum(deviations[1:] ** 2, axis=1) / 1e-3**2
    assert rewards == pytest.approx(-squares, abs=1e-4)
    assert np.max(squares) > 0.01
    assert info["deviation"] == pytest.approx(np.linalg.norm(deviations[-1]), abs=2e-7)
    assert info["time"] == task.motion.t[-1]


@pytest.mark.parametrize("period", [1e-3, 1.5e-3])
def test_a_law_in_it_is_the_sampled_controller(task, period):
    """To the bit: with limits of 4 N m torques are not rounded; the last period may be a shorter one."""
    stiffness, damping = 60.0, 0.5

    class Law:
        def start(self, plant=None):
            self.last = None

        def step(self, k, t, e):
            last = e if self.last is None else self.last
            self.last = e
            return np.clip(-stiffness * e - damping * (e - last) / period, -4.0, 4.0)

    env = pf.Environment(task, mode="++++", period=period, limits=4.0, sensors=ENCODERS)
    law = Law()
    law.start()
    observed, *_ = episode(env, 0, lambda seen: law.step(0, 0.0, seen) / 4.0)
    controller = SampledController(Law(), period=period, inputs=ENCODERS, reference="plan")
    run = Simulation(task, mode="++++", feed_forward=True).run(controller)
    (record,) = run.controllers
    assert len(observed) == record.t.size + 1
    found = env.simulation.result()
    assert np.array_equal(found.solution.q, run.solution.q)
    assert np.array_equal(found.applied, run.applied)
    assert found.solution.status == "complete"


def test_the_plan_is_seen_ahead(task):
    env = pf.Environment(task, mode="++++", sensors=["x", "A1"], ahead=(0.005, 0.02), scales={"x": 1e-3}, errors=False)
    assert env.observed == ("x", "A1", "x+0.005", "A1+0.005", "x+0.02", "A1+0.02")
    observed, *_ = episode(env, 0, still(env))
    x = task.motion.desired.position[:, 0]
    later = np.minimum(np.arange(41) + 20, 40)
    assert observed[:, 4] == pytest.approx((x[later] - x) / 1e-3, abs=1e-9)
    assert observed[0, 0] == pytest.approx(x[0] / 1e-3, rel=1e-12)
    assert np.ptp(observed[:, 3]) > 1e-3


# --- Rewards and ends -------------------------------------------------------------------------------------------------


def test_the_reward(task):
    env = pf.Environment(
        task, mode="+-+-", accuracy=2e-3, effort_weight=0.5, limits={"tau1": 2.0, "tau5": 1.0}, penalty=3.0
    )
    assert env.motors == ("tau1", "tau5")
    env.reset(seed=0)
    action = np.array([0.5, -1.5], dtype=np.float32)
    seen, reward, terminated, truncated, info = env.step(action)
    assert (terminated, truncated) == (False, False)
    assert np.array_equal(info["torques"], [1.0, -1.0])
    assert info["deviation"] == pytest.approx(np.hypot(*seen[-2:]), rel=1e-9)
    assert reward == pytest.approx(-((info["deviation"] / 2e-3) ** 2) - 0.5 * 1.25)
    assert np.array_equal(
        env.simulation.result().applied[0], env.simulation.result().torques.evaluate(np.zeros(1))[0] + [1, 0, -1, 0]
    )
    costs = episode(pf.Environment(task, accuracy=1e-6, penalty=3.0))[1]
    assert np.min(costs) == -3.0


def test_limits_are_those_of_the_plan(task):
    peak = np.max(np.abs(task.torques("++++").evaluate(task.motion.t)))
    assert pf.Environment(task).limits == pytest.approx(0.1 * peak)
    assert pf.Environment(task, feed_forward=False).limits == pytest.approx(peak)


def test_a_reward_of_ones_own():
    env = of_rotor()
    observed, rewards, info = episode(env, 0)
    assert rewards.size == 20
    assert np.array_equal(rewards, -observed[1:, 0])
    assert set(info) == {"time", "torques"}


def test_what_diverges_is_terminated(task):
    """Motors against one another at 1 kHz, in steps as long: joints come apart."""
    coarse = pf.IntegrationOptions(method="tr-bdf2", step=1e-3, constraints="baumgarte")
    env = pf.Environment(task, mode="++++", limits=50.0, options=coarse, penalty=20.0)
    signs = iter([1.0, -1.0] * 40)
    observed, rewards, info = episode(env, 0, lambda seen: next(signs) * np.array([1.0, -1.0, 1.0, -1.0]))
    assert rewards.size < 40
    assert "come apart" in info["error"]
    assert np.array_equal(observed[-1], observed[-2])
    assert rewards[-1] == -20.0 * (41 - rewards.size)
    assert np.min(rewards[:-1]) >= -20.0
    with pytest.raises(gymnasium.error.ResetNeeded, match="the episode has ended"):
        env.step(np.zeros(4))
    assert np.array_equal(env.reset(seed=0)[0], observed[0])


def test_an_event_terminates_it():
    options = pf.IntegrationOptions(events=[pf.JointLimit("hub", low=0.8)])
    env = of_rotor(options=options, penalty=0.0)
    _, rewards, info = episode(env, 0, lambda seen: [-1.0])
    assert info["error"].startswith("the run has ended: joint hub reached")
    assert (rewards.size, rewards[-1]) == (9, 0.0)


def test_steps_after_the_end_and_before_the_beginning(env):
    fresh = of_rotor()
    with pytest.raises(gymnasium.error.ResetNeeded):
        fresh.step([0.0])
    episode(fresh, 0)
    with pytest.raises(gymnasium.error.ResetNeeded):
        fresh.step([0.0])


# --- Bad input --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"mode": "+-"}, "mode"),
        ({"period": 0.0}, "period: must be positive"),
        ({"limits": -1.0}, r"limits\.tau1: must be positive"),
        ({"limits": {"tau9": 1.0}}, "limits: unknown motor"),
        ({"limits": {"tau1": 1.0}}, r"limits: tau2, tau5, tau6 missing"),
        ({"limits": "much"}, "limits: not "),
        ({"sensors": ["z"]}, "sensors: unknown sensor"),
        ({"noise": {"z": 1.0}}, "noise: unknown observed sensor"),
        ({"noise": {"x": -1.0}}, r"noise\.x: not a positive number"),
        ({"quantise": {"x": np.inf}}, r"quantise\.x: not a positive number"),
        ({"scales": {"x": 0.0}}, r"scales\.x: not a positive number"),
        ({"ahead": [0.0]}, "ahead: not positive numbers"),
        ({"accuracy": np.nan}, "accuracy: must be positive"),
        ({"effort_weight": -1.0}, "effort_weight: must not be negative"),
        ({"penalty": -1.0}, "penalty: must not be negative"),
        ({"duration": 1.0}, "duration: is set by the plan"),
        ({"reward": 3.0}, "reward: not a function"),
    ],
)
def test_bad_environments(task, more, said):
    with pytest.raises(pf.InputError, match=said):
        pf.Environment(task, **more)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"reward": None}, "reward: there is no plan to follow"),
        ({"limits": None}, "limits: are missing"),
        ({"ahead": [0.01]}, "ahead: there is no plan to look ahead in"),
        ({"feed_forward": True}, "feed_forward: there is no plan"),
        ({"duration": None}, "duration: is missing"),
    ],
)
def test_bad_environments_without_a_plan(more, said):
    with pytest.raises(pf.InputError, match=said):
        of_rotor(**more)


@pytest.mark.parametrize("action", [[0.0] * 3, [np.nan] * 4, 0.0, "much", None])
def test_bad_actions(env, action):
    env.reset(seed=0)
    with pytest.raises(pf.InputError, match=r"action: not 4 finite numbers.*one from -1 to 1 for each of tau1, tau2"):
        env.step(action)


def test_options_of_reset_are_refused(env):
    with pytest.raises(pf.InputError, match="options: there are none"):
        env.reset(options={"saved": 1})


def test_only_mechanisms_with_paths_are_environments_of_the_library():
    with pytest.raises(pf.InputError):
        pf.library.environment("pendulum")
    with pytest.raises(pf.InputError, match="neither a library mechanism nor a file"):
        pf.library.environment("raparm_x")
