"""``python -m usv_gym.cli``."""

from . import main

main()
