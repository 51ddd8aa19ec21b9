"""How far did the procedure that the project started from come, and how far does the project's own?

    python -m studies.ren2013 --data ../shared/practice [CASE ...]
    python -m studies.ren2013 --question speed|ablation [MATERIAL ...]
    python -m studies.ren2013 --question features
    python -m studies.ren2013 --question real --data ../shared/measured [SET ...]

cases      the paper's procedure and this project's fit against each case's truth, beside the paper's Tables I and II
speed      the paper's simplex from all its starts, and the fast search down the same metric
ablation   what hangs on the constants that the paper's lost appendix held
features   the paper's greedy extraction and this project's
real       the paper's procedure and this project's fit on real bodies with a mesh
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from studies.ren2013 import ablation, cases, features, real_bodies, speed


def main() -> int:
    """Runs one question."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.ren2013", description=__doc__.splitlines()[0] if __doc__ else ""
    )
    parser.add_argument("--question", choices=["cases", "speed", "ablation", "features", "real"], default="cases")
    parser.add_argument("--data", type=Path, help="the folder of cases")
    parser.add_argument("names", nargs="*", metavar="NAME", help="cases, or materials; all by default")
    asked = parser.parse_args()
    names = tuple(asked.names)
    if asked.question == "speed":
        return speed.main(names or speed.NAMES)
    if asked.question == "ablation":
        return ablation.main(names or ablation.NAMES)
    if asked.question == "features":
        return features.main()
    if asked.data is None:
        parser.error("--data is needed: the folder of cases")
    if asked.question == "real":
        return real_bodies.main(asked.data, names)
    return cases.main(asked.data, list(names))


if __name__ == "__main__":
    sys.exit(main())
