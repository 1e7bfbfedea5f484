"""A learned policy and its file: weights, and everything that gives their numbers a meaning.

``policy.zip`` is what stable-baselines3 writes plus ``usv_gym.json``: task, spaces, the scales of observations and actions,
how it was trained, and a hash over all of it.  Observations are normalised by the environment, so there are no running
statistics to keep.  Reading takes ``policy.pth`` with ``weights_only=True`` and builds the network from the JSON: nothing in
the file is executed.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, BinaryIO, Literal

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..config import ConfigError, Document, Model, validate
from ..tasks.task import DISCRETE, TaskConfig, observation_space

FORMAT, VERSION, MEMBER = "usv-policy", 1, "usv_gym.json"


class Network(Model):
    """Two perceptrons of this shape, one for the actions and one for their value, behind a common look at the targets."""

    layers: tuple[Annotated[int, Field(ge=1, le=4096)], ...] = Field(default=(64, 64), max_length=8)
    activation: Literal["tanh", "relu"] = "tanh"
    encoder: int = Field(default=64, ge=0, le=4096)  #: width of what looks at each target; 0: none

    def arguments(self, task: TaskConfig) -> dict[str, Any]:
        """The ``policy_kwargs`` of stable-baselines3."""
        nn = _torch().nn
        arguments = {"net_arch": list(self.layers), "activation_fn": nn.Tanh if self.activation == "tanh" else nn.ReLU}
        if not self.encoder or task.observation == "sectors":
            return arguments
        from .networks import TargetEncoder

        look = {"width": self.encoder, "range_scale": task.range_scale, "targets": task.targets}
        return {**arguments, "features_extractor_class": TargetEncoder, "features_extractor_kwargs": look}


class LearnedPolicy:
    """A controller with a network in it.

    ``task`` is the decision problem that it was trained for; an environment made with these arguments fits it.  ``scales``
    is what the numbers of observations and actions meant.
    """

    def __init__(self, name: str, network: Any, task: TaskConfig, scales: Mapping[str, Any]) -> None:
        self.name, self.network, self.task, self.scales = name, network, task, scales

    def reset(self, info: dict[str, Any]) -> None:
        """Check that observations and actions mean what they meant in training.

        Raises
        ------
        ConfigError
            one line that names every difference.
        """
        here = {key: info["scales"].get(key) for key in self.scales}
        if wrong := differences(self.scales, here):
            raise ConfigError(f"policy {self.name}: was trained for something else: {wrong}")

    def act(self, observation: Any) -> NDArray[Any]:
        """The action for one observation."""
        with one_thread():
            action: NDArray[Any] = self.network.predict(observation, deterministic=True)[0]
        return action

    def act_batch(self, observations: Any, mask: Any = None) -> NDArray[Any]:
        """The actions [B, n] for observations [B, ...]; the network tells one from many by the shape."""
        return self.act(observations)


@contextmanager
def one_thread() -> Iterator[None]:
    """PyTorch on one thread: networks of this size gain nothing from two, and wait for ever when a core is busy."""
    torch = _torch()
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def describe(space: gym.Space[Any]) -> Any:
    """A space as plain data."""
    if isinstance(space, gym.spaces.Dict):
        return {key: describe(part) for key, part in space.spaces.items()}
    if isinstance(space, gym.spaces.Discrete):
        return f"Discrete({space.n})"
    return f"{type(space).__name__}{list(space.shape or ())} {space.dtype}"


def differences(trained: Mapping[str, Any], here: Mapping[str, Any], path: str = "") -> str:
    """``a.b 1 -> 2, c 3 -> nothing``: where two nested mappings differ, or ""."""
    found: list[str] = []
    for key in dict.fromkeys([*trained, *here]):
        a, b = trained.get(key), here.get(key)
        if isinstance(a, Mapping) and isinstance(b, Mapping):
            found.append(differences(a, b, f"{path}{key}."))
        elif a != b:
            found.append(f"{path}{key} {_show(a)} -> {_show(b)}")
    return ", ".join(filter(None, found))


def _show(value: Any) -> str:
    return "nothing" if value is None else str(value)


def digest(meta: Mapping[str, Any]) -> str:
    """SHA-256 over the metadata of a policy, without its own ``hash``."""
    data = {key: value for key, value in meta.items() if key != "hash"}
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()


def write_policy(model: Any, file: BinaryIO, meta: Mapping[str, Any]) -> None:
    """Write the model of stable-baselines3 with its metadata.

    ``meta`` holds ``task``, ``scales``, ``network`` and whatever else tells of the training.
    """
    spaces = {"observation": describe(model.observation_space), "action": describe(model.action_space)}
    complete = json.loads(json.dumps({"format": FORMAT, "version": VERSION, "spaces": spaces, **meta}))
    complete["hash"] = digest(complete)
    buffer = io.BytesIO()
    model.save(buffer)
    with zipfile.ZipFile(buffer, "a") as archive:
        archive.writestr(MEMBER, json.dumps(complete, indent=1))
    file.write(buffer.getvalue())


def read_meta(path: str | Path) -> dict[str, Any]:
    """The metadata of a policy file, checked.

    Raises
    ------
    ConfigError
        if it is none, was changed by hand, or its task means something else in this version of the package.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            meta = json.loads(archive.read(MEMBER))
    except FileNotFoundError:
        raise ConfigError(f"policy {path}: no such file") from None
    except KeyError:
        raise ConfigError(
            f"policy {path}: has no {MEMBER}, so usv-gym did not write it; stable-baselines3 can load it, but that executes "
            "code from the file: give --trust if you know who made it"
        ) from None
    except (OSError, zipfile.BadZipFile, ValueError) as error:
        raise ConfigError(f"policy {path}: is no policy file: {error}") from None
    if not isinstance(meta, dict) or meta.get("format") != FORMAT or meta.get("version") != VERSION:
        raise ConfigError(f"policy {path}: expected {FORMAT} version {VERSION} in {MEMBER}")
    groups = all(isinstance(meta.get(key), dict) for key in ("task", "scales", "network", "spaces"))
    if not groups or not isinstance(meta["scales"].get("channels"), int):
        raise ConfigError(f"policy {path}: {MEMBER} lacks task, scales, network or spaces")
    if meta.get("hash") != digest(meta):
        raise ConfigError(f"policy {path}: {MEMBER} does not match its hash: it was changed after it was saved")
    space = describe(observation_space(task_of(meta, path)))
    if wrong := differences({"observation": meta["spaces"].get("observation")}, {"observation": space}):
        raise ConfigError(f"policy {path}: is of another version of usv_gym: {wrong}")
    return meta


def task_of(meta: Mapping[str, Any], path: str | Path) -> TaskConfig:
    """The task that a policy was trained for."""
    return validate(TaskConfig, Document(f"policy {path}", dict(meta["task"])))


def read_tensors(path: str | Path, member: str) -> Any:
    """A ``.pth`` member of a policy file; only tensors and plain data are accepted.

    Raises
    ------
    ConfigError
        if it is missing or holds anything else.
    """
    torch = _torch()
    try:
        with zipfile.ZipFile(path) as archive:
            return torch.load(io.BytesIO(archive.read(member)), map_location="cpu", weights_only=True)
    except Exception as error:  # torch raises several kinds
        reason = str(error).splitlines()[0]
        raise ConfigError(f"policy {path}: {member} cannot be read as plain weights: {reason}") from None


def load_policy(path: str | Path, *, trust: bool = False) -> LearnedPolicy:
    """Read a policy file.

    Parameters
    ----------
    path
        a file that :func:`write_policy` wrote.
    trust
        also take a file that stable-baselines3's PPO wrote by itself, for the default task; that executes code in the file.

    Raises
    ------
    ConfigError
        for a file that is broken, foreign, or does not fit this version of the package.
    """
    try:
        meta = read_meta(path)
    except ConfigError:
        if not trust or not zipfile.is_zipfile(path) or MEMBER in zipfile.ZipFile(path).namelist():
            raise
        return _load_foreign(path)
    _torch()
    from stable_baselines3.common.policies import ActorCriticPolicy, MultiInputActorCriticPolicy

    task = task_of(meta, path)
    kind: Any = ActorCriticPolicy if task.flat else MultiInputActorCriticPolicy
    shape = validate(Network, Document(f"policy {path}", dict(meta["network"])))
    actions = gym.spaces.Discrete(len(DISCRETE)) if task.action == "discrete" else gym.spaces.Box(
        -1.0, 1.0, (meta["scales"]["channels"],), np.float32)  # fmt: skip
    network = kind(observation_space(task), actions, lambda _: 0.0, **shape.arguments(task))
    weights = read_tensors(path, "policy.pth")
    try:
        network.load_state_dict(weights)
    except (RuntimeError, TypeError) as error:
        reason = " ".join(str(error).split())
        raise ConfigError(f"policy {path}: weights do not fit the network that {MEMBER} describes: {reason}") from None
    network.set_training_mode(False)
    return LearnedPolicy(str(path), network, task, meta["scales"])


def _load_foreign(path: str | Path) -> LearnedPolicy:
    _torch()
    from stable_baselines3 import PPO

    try:
        model = PPO.load(path, device="cpu")
    except Exception as error:  # whatever the code in the file raises
        raise ConfigError(f"policy {path}: PPO cannot load it: {' '.join(str(error).split())}") from None
    discrete = isinstance(model.action_space, gym.spaces.Discrete)
    task = TaskConfig(
        flat=not isinstance(model.observation_space, gym.spaces.Dict), action="discrete" if discrete else "default"
    )
    here = {"observation": describe(observation_space(task))}
    if wrong := differences({"observation": describe(model.observation_space)}, here):
        raise ConfigError(f"policy {path}: without {MEMBER}, only the default task will do: {wrong}")
    channels = 1 if discrete else int(np.prod(model.action_space.shape or ()))
    return LearnedPolicy(str(path), model.policy, task, {"channels": channels})


def _torch() -> Any:
    try:
        import stable_baselines3  # noqa: F401
        import torch
    except ImportError as error:
        raise ConfigError(f"a learned policy needs stable-baselines3 ({error}): pip install 'usv-gym[train]'") from None
    return torch
