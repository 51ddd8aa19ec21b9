"""Commands over many cases: CASE folders -> jobs, on this machine or a cluster -> a folder a case, a table of all."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sonic_bullet.options.fit import DiagnoseOptions, FitOptions


def run_one_or_many(command: str, sources: Sequence[str], options: FitOptions | DiagnoseOptions) -> None:
    """Run `fit` or `diagnose` on what it is given; raises SonicBulletError.

    A case alone is done as many are where -o names a folder.
    """
    to = options.output
    into_folder = to is not None and not Path(to).suffix and Path(sources[0]).is_dir()
    if len(sources) > 1 or options.many.given or into_folder:
        from sonic_bullet.apps.cli.many.many_cases import run_many

        run_many(command, sources, options)
    elif isinstance(options, FitOptions):
        from sonic_bullet.apps.cli.fit_command import run_fit

        run_fit(sources[0], options)
    else:
        from sonic_bullet.apps.cli.diagnose_command import run_diagnose

        run_diagnose(sources[0], options)
