"""Train a policy, keep it with all that it needs, and say how good it is: ``usv-gym train``.  Needs the extra ``train``."""

from __future__ import annotations

import importlib.util
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from .config import ConfigError, Document, Model, suggestion, validate
from .envs import ENVIRONMENTS
from .envs.vector import USVVectorEnv
from .metrics.intervals import clopper_pearson
from .policies import make_policy
from .policies.learned import (
    LearnedPolicy,
    Network,
    differences,
    load_policy,
    one_thread,
    read_meta,
    read_tensors,
    write_policy,
)
from .replay.archive import replacing
from .tasks.task import OUTCOMES, TaskConfig, unflatten
from .voyage import task_of

if TYPE_CHECKING:
    from rich.console import Console

#: seeds of the evaluation begin here; those of training end below
HELD_OUT = 1_000_000
#: (environment steps so far, in all, mean return and success rate of the last 100 episodes)
Progress = Callable[[int, int, float, float], None]


class Environment(TaskConfig):
    """Arguments of the environment: the task, and what else ``gym.make`` takes."""

    scenario: Any = None
    vessel: str | None = None
    difficulty: float | None = None
    weather: str | dict[str, Any] | None = None
    max_episode_steps: int | None = Field(default=None, ge=1)


class PPO(Network):
    """Hyperparameters of proximal policy optimisation.

    The defaults suit about a million steps: rollouts of many worlds, large batches and a network small enough for a CPU.
    """

    n_steps: int = Field(default=128, ge=2)  #: steps of each world between two updates
    batch_size: int = Field(default=2048, ge=2)
    n_epochs: int = Field(default=6, ge=1)
    learning_rate: float = Field(default=1e-3, gt=0)  #: at the start; falls to a tenth in a straight line
    gamma: float = Field(default=0.97, gt=0, le=1)  #: a collision counts about half a minute ahead
    gae_lambda: float = Field(default=0.95, ge=0, le=1)
    clip_range: float = Field(default=0.2, gt=0)
    ent_coef: float = Field(default=0.0, ge=0)
    vf_coef: float = Field(default=0.5, ge=0)
    max_grad_norm: float = Field(default=0.5, gt=0)
    log_std_init: float = -1.0  #: of the actions at the start
    reward_scale: float = Field(default=0.1, gt=0)  #: on the rewards that PPO sees, so that values are of order 1


class Training(Model):
    """All that decides what a policy learns; part of its file."""

    id: str
    algo: Literal["ppo"] = "ppo"
    envs: int = Field(default=64, ge=1)
    seed: int = Field(default=0, ge=0)
    env: Environment = Environment()
    ppo: PPO = PPO()
    scenario: tuple[str, ...] = ()  #: overrides of the scenario, ``KEY=VALUE``

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments of ``gym.make`` and ``gym.make_vec``."""
        return {**self.env.dump(), "overrides": list(self.scenario)}


def plan_training(
    id: str, *, algo: str = "ppo", envs: int = 64, seed: int = 0, settings: Sequence[str] = ()
) -> Training:
    """Read what a training needs.

    ``settings`` are ``KEY=VALUE``: ``env.KEY`` is an argument of the environment, ``ppo.KEY`` a hyperparameter, and any other
    a key of the scenario as in ``usv-gym run``.  The id may do without ``usv_gym/``.

    Raises
    ------
    ConfigError
        for anything that is wrong.
    """
    full = id if "/" in id else f"usv_gym/{id}"
    if full not in ENVIRONMENTS:
        raise ConfigError(f"unknown environment {id!r}{suggestion(full, ENVIRONMENTS)}")
    if seed + envs > HELD_OUT:
        raise ConfigError(f"seed: expected at most {HELD_OUT - envs}, got {seed}; the evaluation has those from {HELD_OUT}")
    ours = [text for text in settings if re.match(r"\s*(env|ppo)\s*\.", text)]
    data = {"id": full, "algo": algo, "envs": envs, "seed": seed, "env": {}, "ppo": {},
            "scenario": [text for text in settings if text not in ours]}  # fmt: skip
    return validate(Training, Document("training", data).override(ours))


@dataclass(frozen=True)
class Evaluation:
    """What a controller did on some seeds."""

    policy: str
    outcomes: tuple[str, ...]  #: how each episode ended
    returns: NDArray[np.float64]  #: [n]
    closest: NDArray[np.float64]  #: [n] smallest hull distance to anything [m]

    def rate(self, outcome: str) -> tuple[float, float, float]:
        """Share of episodes that ended so, and its 95 % Clopper-Pearson interval."""
        k, n = self.outcomes.count(outcome), len(self.outcomes)
        return k / n, *clopper_pearson(k, n)

    def summary(self) -> dict[str, Any]:
        """Plain data: rates with their intervals by outcome."""
        return {
            "policy": self.policy,
            "episodes": len(self.outcomes),
            "mean_return": float(self.returns.mean()),
            "rates": {name: dict(zip(("rate", "low", "high"), self.rate(name), strict=True)) for name in OUTCOMES[1:]},
        }


def evaluate(
    controller: Any, id: str, seeds: Sequence[int], *, name: str = "", **arguments: Any
) -> Evaluation:
    """One episode per seed, all at once; ``arguments`` are those of ``gym.make`` but for the task, which the controller has.

    ``controller`` is a :class:`~usv_gym.policies.learned.LearnedPolicy`, which decides for all worlds in one call, or a
    function that makes a :class:`~usv_gym.policies.Controller`, one for each world.
    """
    learned = isinstance(controller, LearnedPolicy)
    controllers = [controller] if learned else [controller() for _ in seeds]
    task = task_of(controllers[0])
    env = gym.make_vec(id, len(seeds), autoreset_mode="Disabled", **arguments, **task.dump())
    assert isinstance(env, USVVectorEnv)
    core = env.core
    env.reset(seed=list(seeds))
    for b, one in enumerate(controllers):
        one.reset({**core.info(b), "scales": core.scales()})
    running = np.ones(len(seeds), np.bool_)
    returns = np.zeros(len(seeds))
    actions = np.zeros(env.action_space.shape or (), env.action_space.dtype)
    while running.any():
        if learned:
            actions = controller.act_batch(env.observation())
        else:
            for b in np.flatnonzero(running).tolist():
                obs = core.obs[b]
                actions[b] = controllers[b].act(obs.copy() if task.flat else unflatten(task, obs))
        env.advance(actions, running)
        returns[running] += core.reward[running]
        running &= ~(core.terminated | core.truncated)
    outcomes = tuple(OUTCOMES[k] for k in core.episodes["outcome"])
    return Evaluation(name or str(getattr(controller, "name", "")), outcomes, returns, core.episodes["closest"].copy())


def train(
    training: Training,
    steps: int,
    out: Path,
    *,
    resume: bool = False,
    episodes: int = 200,
    checkpoints: int = 10,
    progress: Progress | None = None,
) -> list[Evaluation]:
    """Train for ``steps`` environment steps in all and leave ``policy.zip``, checkpoints, logs and ``evaluation.json``.

    An interrupted training leaves a checkpoint; ``resume`` goes on from the latest one, with fresh episodes.  Returns the
    evaluations of the policy and of ``waypoints`` on the same held-out seeds (none if ``episodes`` is 0).

    Raises
    ------
    ConfigError
        if the directory holds a training already, or none to resume, or one of another configuration.
    """
    try:
        from .sb3 import make_vec_env
    except ImportError as error:
        raise ConfigError(str(error)) from None
    from stable_baselines3.common.logger import configure

    if steps < 1:
        raise ConfigError(f"steps: expected at least 1, got {steps}")
    before = sorted((out / "checkpoints").glob("*.zip")) + sorted(out.glob("policy.zip"))
    if before and not resume:
        raise ConfigError(f"{out}: holds a training already; give --resume to go on with it, or another --out")
    if resume and not before:
        raise ConfigError(f"{out}: holds no training to resume")
    try:
        env = make_vec_env(training.id, training.envs, reward_scale=training.ppo.reward_scale, **training.arguments())
    except ConfigError:
        raise
    except (TypeError, ValueError) as error:  # an argument that this environment does not take
        raise ConfigError(f"{training.id}: {error}") from None
    model = _model(training, env)
    if resume:
        _restore(model, max(before, key=lambda path: int(read_meta(path)["steps"])), training)
    done = int(model.num_timesteps)
    env.seed(training.seed if not done else training.seed + done % (HELD_OUT - training.seed - training.envs))
    core = env.env.core
    shape = Network(**{key: getattr(training.ppo, key) for key in Network.model_fields})
    meta = {"training": training.dump(), "task": core.config.dump(), "network": shape.dump(), "scales": core.scales()}

    def save(path: Path) -> None:
        with replacing(path) as file:
            write_policy(model, file, {**meta, "steps": int(model.num_timesteps)})

    final = out / "policy.zip"
    if done < steps:
        formats = ["csv", *(["tensorboard"] if importlib.util.find_spec("tensorboard") else [])]
        model.set_logger(configure(str(out / "logs" / str(done)), formats))

        def checkpoint() -> None:
            save(out / "checkpoints" / f"{model.num_timesteps:012d}.zip")

        watch = _watch(steps, max(steps // max(checkpoints, 1), 1), checkpoint, progress)
        try:
            with one_thread():
                model.learn(steps - done, callback=watch, reset_num_timesteps=False)
        except KeyboardInterrupt:
            checkpoint()
            raise
        finally:
            model.logger.close()
    save(final)
    env.close()
    if not episodes:
        return []
    seeds = range(HELD_OUT, HELD_OUT + episodes)
    task = TaskConfig.keys()
    conditions = {key: value for key, value in training.arguments().items() if key not in task}
    results = [
        evaluate(load_policy(final), training.id, seeds, name="policy", **conditions),
        evaluate(lambda: make_policy("waypoints"), training.id, seeds, name="waypoints", **conditions),
    ]
    text = json.dumps([result.summary() for result in results], indent=1)
    (out / "evaluation.json").write_text(text + "\n", encoding="utf-8")
    return results


def print_evaluations(results: Sequence[Evaluation], console: Console) -> None:
    """A line for each controller: rates of arrival and collision with their intervals."""
    from rich.table import Table

    if not results:
        return
    table = Table(title=f"{len(results[0].outcomes)} held-out seeds, 95 % intervals", title_justify="left")
    for heading in ("policy", "arrival", "collision", "mean return"):
        table.add_column(heading, justify="left" if heading == "policy" else "right")
    for result in results:
        rates = ["{:.1%} ({:.1%} to {:.1%})".format(*result.rate(name)) for name in ("arrival", "collision")]
        table.add_row(result.policy, *rates, f"{result.returns.mean():.1f}")
    console.print(table)


def _model(training: Training, env: Any) -> Any:
    from stable_baselines3 import PPO as Algorithm

    ppo = training.ppo
    same = ("n_steps", "n_epochs", "gamma", "gae_lambda", "clip_range", "ent_coef", "vf_coef", "max_grad_norm")
    rate = ppo.learning_rate
    return Algorithm(
        "MlpPolicy" if training.env.flat else "MultiInputPolicy",
        env,
        batch_size=min(ppo.batch_size, ppo.n_steps * training.envs),
        learning_rate=lambda left: rate * (0.1 + 0.9 * left),
        policy_kwargs={**ppo.arguments(training.env), "log_std_init": ppo.log_std_init},
        seed=training.seed,
        device="cpu",
        **{key: getattr(ppo, key) for key in same},
    )


def _restore(model: Any, path: Path, training: Training) -> None:
    """Put weights, optimiser and step count of a policy file into a model of the same configuration."""
    meta: Mapping[str, Any] = read_meta(path)
    if wrong := differences(meta["training"], training.dump()):
        raise ConfigError(f"{path}: cannot be resumed with another configuration: {wrong}")
    model.policy.load_state_dict(read_tensors(path, "policy.pth"))
    model.policy.optimizer.load_state_dict(read_tensors(path, "policy.optimizer.pth"))
    model.num_timesteps = int(meta["steps"])


def _watch(steps: int, every: int, checkpoint: Callable[[], None], progress: Progress | None) -> Any:
    """The callback that takes checkpoints and reports."""
    from stable_baselines3.common.callbacks import BaseCallback

    class Watch(BaseCallback):
        def _on_training_start(self) -> None:
            self.next = self.num_timesteps + every

        def _on_rollout_end(self) -> None:
            seen = list(self.model.ep_info_buffer or ())
            success = list(self.model.ep_success_buffer or ())
            if progress is not None:
                progress(
                    min(self.num_timesteps, steps),
                    steps,
                    float(np.mean([one["r"] for one in seen])) if seen else float("nan"),
                    float(np.mean(success)) if success else float("nan"),
                )

        def _on_rollout_start(self) -> None:
            # here and not at the end of a rollout: the weights are those that the steps so far have led to
            if self.num_timesteps >= self.next:
                self.next = self.num_timesteps + every
                checkpoint()

        def _on_step(self) -> bool:
            return True

    return Watch()
