"""Networks for the observations of this package.  Imports torch; load it only where a learned policy is."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import torch
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import nn

from ..tasks.task import N_OWN, N_TARGET

_REACHES = (50.0, 150.0, 500.0)  # [m] over which closeness falls off


class TargetEncoder(BaseFeaturesExtractor):
    """Own features, and what matters most among the targets: one small network looks at each, and the largest wins.

    It sees a target with the own ship's features, its direction, and its closeness on three scales; whatever it learns of one
    slot holds for all, and the order of the targets does not matter.  Sectors of land go on as they are.
    """

    def __init__(self, space: gym.Space[Any], width: int, range_scale: float, targets: int) -> None:
        self.targets = N_OWN + targets * N_TARGET  # where they end
        if isinstance(space, gym.spaces.Dict):
            land = sum(gym.spaces.flatdim(space[name]) for name in ("land", "chart") if name in space.spaces)
        else:
            land = gym.spaces.flatdim(space) - self.targets
        super().__init__(space, N_OWN + width + land)
        self.range_scale = range_scale
        self.each = nn.Sequential(
            nn.Linear(N_OWN + N_TARGET + 2 + len(_REACHES), width), nn.ReLU(), nn.Linear(width, width), nn.ReLU()
        )

    def forward(self, observations: Any) -> torch.Tensor:
        """Features [B, N_OWN + width + sectors of land] of flat or Dict observations."""
        if isinstance(observations, dict):
            own, targets = observations["own"], observations["targets"]
            land = [observations[name] for name in ("land", "chart") if name in observations]
        else:
            own, land = observations[:, :N_OWN], [observations[:, self.targets :]]
            targets = observations[:, N_OWN : self.targets].unflatten(1, (-1, N_TARGET))
        position = targets[..., 1:3] * self.range_scale
        distance = torch.linalg.vector_norm(position, dim=-1, keepdim=True)
        features = torch.cat(
            [
                own[:, None].expand(-1, targets.shape[1], -1),
                targets,
                position / (distance + 1.0),
                *(torch.exp(-distance / reach) for reach in _REACHES),
            ],
            dim=-1,
        )
        return torch.cat([own, (self.each(features) * targets[..., :1]).amax(1), *land], dim=-1)
