"""``python -m sonic_bullet``: the command line."""

from sonic_bullet.cli import main

if __name__ == "__main__":
    main()
