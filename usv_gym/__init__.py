"""usv_gym: train, evaluate and verify collision avoidance for unmanned surface vehicles."""

from .envs import register_all as _register_all

__version__ = "0.1.0"

_register_all()
