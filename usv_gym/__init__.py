"""usv_gym: train, evaluate and verify collision avoidance for unmanned surface vehicles."""

__version__ = "0.1.0"
