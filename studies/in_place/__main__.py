"""Does what lies on a table stop ringing as physics says? One table of what must hold: figure, bound, met or missed.

    python -m studies.in_place [--only PART ...]

"Newton" is `tests/made/newton.py`, exact; "run" is `engine.contact.coupling.first_order`, whose poles scenes play.
"""

from __future__ import annotations

import argparse
import time

from studies.in_place import closed_forms, forks, standing
from studies.in_place.lines import HEAD

PARTS = {
    "bar_exact": closed_forms.spring_and_dashpot,
    "limits": closed_forms.limits,
    "reciprocity": closed_forms.reciprocity,
    "passive": closed_forms.passive,
    "loads": closed_forms.loads,
    "rod": standing.rod_on_two_points,
    "bowl": standing.bowl_on_its_foot,
    "rim": standing.bowl_upside_down,
    "glass": standing.glass_on_its_foot,
    "bar": standing.bar_on_pads,
    "fork": forks.fork_on_board,
    "matched": forks.matched_board,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--only", nargs="*", choices=tuple(PARTS), default=list(PARTS))
    begun, missed = time.process_time(), 0
    print(HEAD)
    for name in parser.parse_args().only:
        for line in PARTS[name]():
            print(line.row(), flush=True)
            missed += line.holds is not None and not line.holds
    print(f"\n{missed} missed; {time.process_time() - begun:.0f} s of processor time")


if __name__ == "__main__":
    main()
