"""The command line by ``python -m sonic_bullet``."""

from sonic_bullet.apps.cli import main

if __name__ == "__main__":
    main()
