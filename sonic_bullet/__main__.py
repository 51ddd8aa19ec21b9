"""`python -m sonic_bullet`: the `sonic-bullet` command."""

from sonic_bullet.cli import main

main()
