"""Controllers that do everything wrong, one thing each; flown by test_campaign.py."""

import os
import time


class Good:
    action, flat = "heading_speed", False

    def reset(self, info):
        self.steps = 0

    def act(self, observation):
        self.steps += 1
        return [0.0, 0.4]


class Raises(Good):
    def act(self, observation):
        super().act(observation)
        if self.steps == 4:
            raise ValueError("lost my\nmap")
        return [0.0, 0.0]


class NaN(Good):
    def act(self, observation):
        return [0.0, float("nan")]


class Hangs(Good):
    def act(self, observation):
        super().act(observation)
        while self.steps == 5:
            time.sleep(0.05)
        return [0.0, 0.0]


class ThreeNumbers(Good):
    def act(self, observation):
        return [0.0, 0.0, 0.0]


class Dies(Good):
    def act(self, observation):
        os._exit(7)


class NoReset:
    def act(self, observation):
        return [0.0, 0.0]


class NeedsArguments(Good):
    def __init__(self, brain):
        self.brain = brain
