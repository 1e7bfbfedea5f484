"""The stable-baselines3 adapter, training, and the policy file."""

from __future__ import annotations

import io
import json
import pickle
import subprocess
import sys
import zipfile

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack, VecNormalize
from typer.testing import CliRunner

from usv_gym.cli import app
from usv_gym.config import ConfigError
from usv_gym.metrics.intervals import clopper_pearson
from usv_gym.policies import Controller, make_policy
from usv_gym.policies.learned import MEMBER, LearnedPolicy, digest, load_policy, read_meta
from usv_gym.run import plan, run
from usv_gym.sb3 import SB3VecEnv, make_vec_env
from usv_gym.tasks.task import N_OWN, N_TARGET
from usv_gym.train import HELD_OUT, evaluate, plan_training, train

torch.set_num_threads(1)  # two wait for each other where a core is busy
OPEN_SEA = "usv_gym/OpenSea-v0"
SHORT = ["simulation.duration=10"]
QUICK = ["ppo.n_steps=8", "ppo.batch_size=16", "ppo.n_epochs=1", "ppo.layers=[8]", "ppo.encoder=4", "simulation.duration=10"]


# --- the adapter -----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("kwargs", [{}, {"flat": False, "observation": "truth"}, {"action": "discrete"}])
def test_equals_dummy_vec_env(kwargs):
    ours = make_vec_env(OPEN_SEA, 3, overrides=SHORT, **kwargs)
    theirs = DummyVecEnv([lambda: Monitor(gym.make(OPEN_SEA, overrides=SHORT, **kwargs)) for _ in range(3)])
    assert (ours.observation_space, ours.action_space) == (theirs.observation_space, theirs.action_space)
    for env in (ours, theirs):
        env.seed(5)
    same(ours.reset(), theirs.reset())
    same(ours.reset_infos, theirs.reset_infos)
    ours.action_space.seed(1)
    ended = 0
    for _ in range(35):
        actions = np.array([ours.action_space.sample() for _ in range(3)])
        a, b = ours.step(actions), theirs.step(actions)
        same(a[:3], b[:3])
        for done, x, y in zip(a[2], a[3], b[3], strict=True):
            if done:
                ended += 1
                x["episode"].pop("t")
                y["episode"].pop("t")
                same(x, y)
            else:
                assert x["TimeLimit.truncated"] is y["TimeLimit.truncated"] is False
        same(ours.reset_infos, theirs.reset_infos)
    assert ended >= 9
    options = [{"difficulty": 0.0}, {"difficulty": 1.0}, {"weather": "calm"}]
    for env in (ours, theirs):
        env.seed(7)
        env.set_options(options)
    same(ours.reset(), theirs.reset())
    for env in (ours, theirs):
        env.seed(7)
        env.set_options({"weather": "thesis"})
    same(ours.reset(), theirs.reset())


def same(a, b) -> None:
    if isinstance(a, dict):
        assert a.keys() == b.keys()
        for key in a:
            same(a[key], b[key])
    elif isinstance(a, list | tuple):
        for x, y in zip(a, b, strict=True):
            same(x, y)
    elif isinstance(a, np.ndarray):
        assert isinstance(b, np.ndarray)
        assert a.dtype == b.dtype
        assert np.array_equal(a, b)
    else:
        assert type(a) is type(b)
        assert a == b


def test_what_was_returned_stays_as_it_was():
    env = make_vec_env(OPEN_SEA, 2, overrides=SHORT)
    actions = np.zeros((2, 2), np.float32)
    before = env.reset()
    kept = before.copy()
    obs, reward, done, _ = env.step(actions)
    later = [x.copy() for x in (obs, reward, done)]
    for _ in range(12):
        env.step(actions)
    assert np.array_equal(before, kept)
    assert all(np.array_equal(x, y) for x, y in zip((obs, reward, done), later, strict=True))


def test_attributes_and_methods_of_rows():
    env = make_vec_env(OPEN_SEA, 3, difficulty=0.25, render_mode="rgb_array")
    env.seed(1)
    env.reset()
    assert env.get_attr("difficulty") == [0.25] * 3
    env.set_attr("difficulty", 1.0, indices=[0, 2])
    assert env.get_attr("difficulty") == [1.0, 0.25, 1.0]
    assert env.get_attr("spec", 1)[0].id == OPEN_SEA
    assert env.has_attr("commands")
    assert not env.has_attr("nothing")
    assert [info["outcome"] for info in env.env_method("info", indices=[1])] == ["running"]
    assert env.env_is_wrapped(Monitor) == [True] * 3
    assert env.env_is_wrapped(gym.wrappers.TimeLimit, 0) == [False]
    assert env.render().shape == (1600, 1600, 3)
    with pytest.raises(AttributeError, match="dificulty"):
        env.set_attr("dificulty", 1.0)
    with pytest.raises(ValueError, match="is not an environment of usv_gym"):
        make_vec_env("CartPole-v1", 2)
    env.close()


def test_scales_rewards_but_not_the_statistics():
    a, b = (make_vec_env(OPEN_SEA, 2, overrides=SHORT, reward_scale=scale) for scale in (1.0, 0.5))
    for env in (a, b):
        env.seed(1)
        env.reset()
    for _ in range(12):
        x, y = a.step(np.ones((2, 2), np.float32)), b.step(np.ones((2, 2), np.float32))
        assert np.allclose(x[1] * 0.5, y[1], atol=1e-6)
        assert [i.get("episode", {}).get("r") for i in x[3]] == [i.get("episode", {}).get("r") for i in y[3]]


def test_goes_through_the_wrappers_and_ppo():
    env = VecFrameStack(VecNormalize(make_vec_env(OPEN_SEA, 4, overrides=SHORT)), 2)
    model = PPO("MlpPolicy", env, n_steps=16, batch_size=32, n_epochs=1, seed=1, device="cpu").learn(256)
    assert model.num_timesteps == 256
    assert len(model.ep_info_buffer) >= 10
    assert {one["l"] for one in model.ep_info_buffer} == {10}
    bare = make_vec_env(OPEN_SEA, 4, overrides=SHORT, flat=False)
    model = PPO("MultiInputPolicy", bare, n_steps=16, batch_size=32, n_epochs=1, device="cpu").learn(64)
    mean, _ = evaluate_policy(model, bare, n_eval_episodes=4)
    assert np.isfinite(mean)


# --- training --------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    out = tmp_path_factory.mktemp("training")
    seen = []
    training = plan_training("OpenSea-v0", envs=4, seed=3, settings=[*QUICK, "env.difficulty=0.3"])
    results = train(training, 96, out, episodes=5, checkpoints=3, progress=lambda *numbers: seen.append(numbers))
    return training, out, results, seen


def test_training_leaves_policy_checkpoints_logs_and_evaluation(trained):
    _, out, results, seen = trained
    assert [done for done, *_ in seen] == [32, 64, 96]
    assert sorted(p.name for p in (out / "checkpoints").iterdir()) == ["000000000032.zip", "000000000064.zip"]
    assert (out / "logs" / "0" / "progress.csv").stat().st_size > 0
    meta = read_meta(out / "policy.zip")
    assert meta["steps"] == 96
    assert meta["task"]["action"] == "throttle_nozzle"
    assert meta["spaces"]["action"] == "Box[2] float32"
    assert meta["training"]["scenario"] == ["simulation.duration=10"]
    assert [result.policy for result in results] == ["policy", "waypoints"]
    assert set(results[0].outcomes) <= {"time_limit", "collision"}
    said = json.loads((out / "evaluation.json").read_text())
    assert said[1]["rates"]["arrival"]["rate"] == 0.0
    assert said[0]["episodes"] == 5


def test_the_file_acts_like_the_model(trained):
    _, out, _, _ = trained
    policy = load_policy(out / "policy.zip")
    assert isinstance(policy, Controller)
    model = PPO.load(out / "policy.zip", device="cpu")  # what stable-baselines3 makes of the same file
    env = make_vec_env(OPEN_SEA, 4)
    obs = env.reset()
    expected = model.predict(obs, deterministic=True)[0]
    assert np.array_equal(policy.act_batch(obs), expected)
    assert np.allclose(policy.act(obs[0]), expected[0], atol=1e-6)


@pytest.mark.parametrize("observation", ["truth", "sectors"])
def test_dict_observations(observation, tmp_path):
    settings = [*QUICK, "env.flat=false", f"env.observation={observation}", "env.targets=3", "env.action=discrete"]
    train(plan_training("OpenSea-v0", envs=2, settings=settings), 16, tmp_path, episodes=2)
    assert load_policy(tmp_path / "policy.zip").task.flat is False


def test_the_order_of_the_targets_does_not_matter(trained):
    _, out, _, _ = trained
    policy = load_policy(out / "policy.zip")
    obs = make_vec_env(OPEN_SEA, 1).observation_space.sample()
    targets = obs[N_OWN:].reshape(-1, N_TARGET)
    targets[:, 0] = [1, 1, 1, 1, 1, 0, 0, 0]
    expected = policy.act(obs)
    for order in ([4, 3, 2, 1, 0, 5, 6, 7], [1, 0, 2, 3, 4, 7, 6, 5]):
        shuffled = np.concatenate([obs[:N_OWN], targets[order].ravel()])
        assert np.allclose(policy.act(shuffled), expected, atol=1e-6)


def test_evaluation_equals_single_environments(trained):
    _, out, _, _ = trained
    policy = load_policy(out / "policy.zip")
    seeds = [HELD_OUT, HELD_OUT + 1]
    minute = {"overrides": ["simulation.duration=60"]}
    for controller, task, result in (
        (policy, policy.task.dump(), evaluate(policy, OPEN_SEA, seeds, **minute)),
        (
            make_policy("waypoints"),
            {"action": "heading_speed", "flat": False},
            evaluate(lambda: make_policy("waypoints"), OPEN_SEA, seeds, **minute),
        ),
    ):
        for k, seed in enumerate(seeds):
            env = gym.make(OPEN_SEA, **minute, **task)
            obs, info = env.reset(seed=seed)
            controller.reset(info)
            total, over = 0.0, False
            while not over:
                obs, reward, terminated, truncated, info = env.step(controller.act(obs))
                total += reward
                over = terminated or truncated
            assert result.outcomes[k] == info["outcome"]
            assert result.closest[k] == pytest.approx(info["closest"], rel=1e-4)
            assert result.returns[k] == pytest.approx(total, rel=1e-4)


def test_resume_goes_on_from_the_latest_checkpoint(trained, tmp_path):
    training, out, _, _ = trained
    (tmp_path / "checkpoints").mkdir()
    for name in ("000000000032.zip", "000000000064.zip"):
        (tmp_path / "checkpoints" / name).write_bytes((out / "checkpoints" / name).read_bytes())
    seen = []
    assert train(training, 128, tmp_path, resume=True, episodes=0, progress=lambda *n: seen.append(n[0])) == []
    assert seen == [96, 128]
    assert read_meta(tmp_path / "policy.zip")["steps"] == 128
    with pytest.raises(ConfigError, match="--resume"):
        train(training, 128, tmp_path)
    with pytest.raises(ConfigError, match="no training to resume"):
        train(training, 128, tmp_path / "elsewhere", resume=True)
    other = plan_training("OpenSea-v0", envs=4, seed=3, settings=[*QUICK, "env.difficulty=0.4"])
    with pytest.raises(ConfigError, match=r"another configuration: env\.difficulty 0\.3 -> 0\.4$"):
        train(other, 128, tmp_path, resume=True)


def test_settings_are_checked():
    for settings, message in (
        (["ppo.gama=0.9"], r"ppo\.gama: unknown key; did you mean 'gamma'"),
        (["ppo.gamma=2"], r"ppo\.gamma: expected a number of at most 1"),
        (["env.observaton=ais"], r"env\.observaton: unknown key; did you mean 'observation'"),
        (["env.reward.collision=much"], r"env\.reward\.collision"),
    ):
        with pytest.raises(ConfigError, match=message):
            plan_training("OpenSea-v0", settings=settings)
    with pytest.raises(ConfigError, match="did you mean 'usv_gym/OpenSea-v0'"):
        plan_training("OpenSee-v0")
    with pytest.raises(ConfigError, match="algo: expected 'ppo'"):
        plan_training("OpenSea-v0", algo="sac")
    with pytest.raises(ConfigError, match="seed"):
        plan_training("OpenSea-v0", seed=HELD_OUT)


def test_conditions_are_checked_before_anything_is_written(tmp_path):
    for settings, message in ((["weather.wnd.speed=1"], "wnd"), (["env.scenario=calm_crossing"], "Scenario-v0")):
        with pytest.raises(ConfigError, match=message):
            train(plan_training("OpenSea-v0", envs=2, settings=[*QUICK, *settings]), 32, tmp_path / "out")
    assert not (tmp_path / "out").exists()


# --- driving with a policy file --------------------------------------------------------------------------------------
def test_a_run_drives_with_the_file(trained, tmp_path):
    _, out, _, _ = trained
    command = ["run", "calm_crossing", "--policy", str(out / "policy.zip"), "--set", "simulation.duration=20",
               "--out", str(tmp_path), "--quiet"]  # fmt: skip
    done = CliRunner().invoke(app, command, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    assert json.loads((tmp_path / "summary.json").read_text())["policy"] == str(out / "policy.zip")


def test_a_mismatch_is_one_clear_error(trained):
    _, out, _, _ = trained
    file = str(out / "policy.zip")
    with pytest.raises(ConfigError, match=r"trained for something else: control_interval 1\.0 -> 0\.5$"):
        run(plan("calm_crossing", policy=file, overrides=["simulation.control_interval=0.5"]))
    with pytest.raises(ConfigError, match=r"max_speed 7\.18 ->"):
        run(plan("calm_crossing", policy=file, vessel="otter", overrides=["own_ship.speed=1"]))


def rewrite(source, target, **members):
    """Copy a policy file with members replaced (None: left out)."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            data = members.get(name, old.read(name))
            if data is not None:
                new.writestr(name, data)
    return target


def test_broken_files_are_refused_with_one_line(trained, tmp_path):
    _, out, _, _ = trained
    good = out / "policy.zip"
    meta = json.loads(zipfile.ZipFile(good).read(MEMBER))

    def sealed(**changes):
        changed = {**meta, **changes}
        return json.dumps({**changed, "hash": digest(changed)})

    junk = tmp_path / "junk.zip"
    junk.write_bytes(b"junk")
    cases = [
        (tmp_path / "missing.zip", "no such file"),
        (junk, "is no policy file"),
        (rewrite(good, tmp_path / "a.zip", **{MEMBER: None}), "--trust"),
        (rewrite(good, tmp_path / "b.zip", **{MEMBER: json.dumps({**meta, "steps": 1})}), "does not match its hash"),
        (rewrite(good, tmp_path / "c.zip", **{MEMBER: "[]"}), "expected usv-policy version 1"),
        (rewrite(good, tmp_path / "d.zip", **{MEMBER: sealed(spaces={"observation": "Box[7] float32"})}), "another version"),
        (rewrite(good, tmp_path / "e.zip", **{MEMBER: sealed(network={"layers": [9], "encoder": 0})}), "weights do not fit"),
        (rewrite(good, tmp_path / "f.zip", **{MEMBER: sealed(network={"layers": [9, -1]})}), "layers"),
        (rewrite(good, tmp_path / "g.zip", **{"policy.pth": None}), "policy.pth"),
        (rewrite(good, tmp_path / "h.zip", **{MEMBER: sealed(task={"action": "fly"})}), "action"),
        (rewrite(good, tmp_path / "i.zip", **{MEMBER: sealed(scales={})}), "scales"),
    ]
    for path, message in cases:
        with pytest.raises(ConfigError, match=message) as caught:
            load_policy(path)
        assert "\n" not in str(caught.value)


class Evil:
    def __reduce__(self):
        return (exec, ("raise SystemExit('code of the file was executed')",))


def test_code_in_a_file_is_not_executed(trained, tmp_path):
    _, out, _, _ = trained
    weights = io.BytesIO()
    torch.save({"weights": Evil()}, weights)
    for members in ({"policy.pth": weights.getvalue()}, {"policy.pth": pickle.dumps(Evil())}):
        with pytest.raises(ConfigError, match="cannot be read as plain weights"):
            load_policy(rewrite(out / "policy.zip", tmp_path / "evil.zip", **members))
    # the pickles of stable-baselines3 are not even looked at
    data = json.dumps({"evil": {":type:": "x", ":serialized:": "gASVAAAAAAAAAAA="}})
    load_policy(rewrite(out / "policy.zip", tmp_path / "evil.zip", data=data))


def test_a_plain_file_of_stable_baselines_needs_trust(tmp_path):
    PPO("MlpPolicy", make_vec_env(OPEN_SEA, 2), n_steps=8, batch_size=8, device="cpu").save(tmp_path / "plain.zip")
    with pytest.raises(ConfigError, match="--trust"):
        plan("calm_crossing", policy=str(tmp_path / "plain.zip"))
    short = ["simulation.duration=5"]
    mission = plan("calm_crossing", policy=str(tmp_path / "plain.zip"), trust=True, overrides=short)
    assert run(mission).meta["policy"].endswith("plain.zip")
    assert isinstance(make_policy(str(tmp_path / "plain.zip"), trust=True), LearnedPolicy)
    small = PPO("MlpPolicy", make_vec_env(OPEN_SEA, 2, targets=2), n_steps=8, batch_size=8, device="cpu")
    small.save(tmp_path / "small.zip")
    with pytest.raises(ConfigError, match="only the default task will do"):
        load_policy(tmp_path / "small.zip", trust=True)


def test_the_command_line_trains(tmp_path):
    command = ["train", "OpenSea-v0", "--steps", "32", "--envs", "2", "--out", str(tmp_path / "run"), "--episodes", "2"]
    for text in QUICK:
        command += ["--set", text]
    done = CliRunner().invoke(app, command, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    assert "waypoints" in done.output
    done = CliRunner().invoke(app, [*command, "--resume"], catch_exceptions=False)
    assert done.exit_code == 0, done.output


def test_without_stable_baselines_one_line_names_the_extra():
    code = (
        "import sys; sys.modules['stable_baselines3'] = None\n"
        "from usv_gym.cli import main\n"
        "sys.argv = ['usv-gym', 'train', 'OpenSea-v0']; main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 2
    assert "pip install 'usv-gym[train]'" in done.stderr
    assert len(done.stderr.splitlines()) == 1


# --- intervals -------------------------------------------------------------------------------------------------------
def test_clopper_pearson_equals_scipy():
    from scipy.stats import binomtest

    for n in (1, 5, 200, 2000):
        for k in {0, 1, n // 3, n - 1, n}:
            expected = binomtest(k, n).proportion_ci(0.95, "exact")
            assert clopper_pearson(k, n) == pytest.approx((expected.low, expected.high), abs=1e-9)
    with pytest.raises(ValueError, match="expected"):
        clopper_pearson(3, 2)


def test_importing_the_package_imports_no_torch():
    code = "import sys, usv_gym, usv_gym.cli, usv_gym.policies; assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_adapter_is_a_vec_env():
    env = make_vec_env(OPEN_SEA, 2)
    assert isinstance(env, SB3VecEnv)
    assert env.num_envs == 2
