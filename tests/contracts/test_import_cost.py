"""What an import and a listener load: nothing that only a computation needs."""

from __future__ import annotations

import subprocess
import sys

HEAVY = ("scipy", "numba", "trimesh", "matplotlib", "skfem", "netgen", "rich", "soundfile", "asyncio", "unittest")


def printed(code: str) -> list[str]:
    """Return the words that a fresh interpreter prints."""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=120)
    return done.stdout.split()


def test_the_package_imports_within_300_ms_and_none_of_what_is_heavy() -> None:
    seconds, *modules = printed(
        "import sys, time; begun = time.process_time(); import sonic_bullet;"
        "print(time.process_time() - begun, *sys.modules)"
    )
    assert float(seconds) < 0.3
    assert not {name.partition(".")[0] for name in modules} & set(HEAVY)


def test_a_listener_loads_no_mesher_no_mock_and_not_all_effects() -> None:
    modules = set(
        printed(
            "import sys, pybullet as p; from pybullet_utils.bullet_client import BulletClient;"
            "import sonic_bullet as sb; sb.attach(BulletClient(p.DIRECT)); print(*sys.modules)"
        )
    )
    assert "sonic_bullet.session.listening" in modules
    assert not modules & {
        "unittest.mock",
        "asyncio",
        "scipy.spatial",
        "scipy.special",
        "sonic_bullet.effects.every_effect",
        "sonic_bullet.modal.meshing.filling",
    }
