"""Examples in each command's help."""

RENDER_EPILOG = """\b
Examples:
  sonic-bullet render scenes/tabletop.py -o tabletop.wav --picture tabletop.png
  sonic-bullet render my_sim.py -o out.flac --material wood
  sonic-bullet render scenes/drop.py -o out.wav --contacts drop.npz --json
  sonic-bullet render scenes/drop.py -o out.wav --contacts small.npz --models reference
  sonic-bullet render scenes/drop.py -o out.wav --material mug=glass --silent board
  sonic-bullet render drop.npz -o again.wav      (the same bits, without PyBullet)
  sonic-bullet render drop.npz -o stereo.wav --microphone 0,-1,0.5 --microphone 0,1,0.5"""

MODES_EPILOG = """\b
Examples:
  sonic-bullet modes mug.obj --material porcelain --scale 0.001
  sonic-bullet modes bar.stl --young 2.1e11 --poisson 0.3 --density 7850 --count 10
  sonic-bullet modes tray.obj --material metal --thickness 0.002 --to-hz 5000 --json tray.json -o tray.npz
  sonic-bullet modes fork.obj --material steel --fix 0,0,-0.1,0.01
  sonic-bullet modes plate.obj --material glass --uff plate.uff"""

BAKE_EPILOG = """\b
Examples:
  sonic-bullet bake bowl.obj --material steel -o bowl.glb       (glTF with KHR_audio_rigid_bodies)
  sonic-bullet bake bowl.obj --material bowl.json --modes 30 --below 60 --points 100 -o bowl.json
  sonic-bullet bake mug.obj --material ceramic-mug -o mug.dsp   (faust2jack mug.dsp)
  sonic-bullet bake mug.obj --material porcelain -o mug.h
  sonic-bullet bake bar.obj --material brass --strike 0.1,0,0.005 --impulse 0.02 -o tap.wav
  sonic-bullet bake scenes/tabletop.py -o scene.glb             (bodies, physics, motion, sound)
  sonic-bullet bake table.npz --body mug -o mug.h"""

FIT_EPILOG = """\b
Examples:
  sonic-bullet fit tap.wav --mesh bar.obj --strike 0.05,0,0.003 --material steel -o bar.json --picture bar.png
  sonic-bullet fit tap.wav --mesh mug.obj --scale 0.001 --strike 0,0.04,0 --sensor sum \
--material porcelain -o mug.json --json
  sonic-bullet fit my_case/ -o preset.json       (several strikes, sizes, sensors: a folder with a case.json)
  sonic-bullet fit my_case/ -o preset.json --dimension-tolerance 0.1 --uff modes.uff
  sonic-bullet fit cases/*/ -o out --workers 4 --csv lines.csv   (a folder a case, and out/summary.csv)
The preset plays at once: listener.add(body, material="preset.json")."""

RESIDUAL_EPILOG = """\b
Examples:
  sonic-bullet residual my_case/ -o preset.json --picture preset.png
  sonic-bullet residual tap.wav --mesh bar.obj --strike 0.05,0,0.003 --material steel -o bar.json
  sonic-bullet residual tap.wav --material wood -o wood.json     \
(no shape known: the recording's features stand in for modes)
Hear a scene without: sonic-bullet render scene.py -o out.wav --no-residual"""

FEATURES_EPILOG = """\b
Examples:
  sonic-bullet features tap.wav
  sonic-bullet features tap.wav --json features.json --picture features.png
  sonic-bullet features tap.flac --band 200,8000 --onset 0"""

DIAGNOSE_EPILOG = """\b
Examples:
  sonic-bullet diagnose my_case/
  sonic-bullet diagnose my_case/ --json verdict.json --predict predicted/ --report page.html
  sonic-bullet diagnose my_case/ --next           (which strike would tell the two best models apart)
  sonic-bullet diagnose my_case/ -o preset.json   (what belongs to material and object sounds in every scene)
  sonic-bullet diagnose cases/*/ -o out --workers 4 --report page.html
A verdict is none, explained, unexplained or worse-than-silence (exit 1)."""

CASE_EPILOG = """\b
Examples:
  sonic-bullet case new my_case --mesh bar.obj --recordings taps/*.wav --material steel --sensor pressure
  sonic-bullet case new my_taps long_recording.wav --split --hold-out 3
  sonic-bullet case new my_taps taps/*.wav --force-channel 1 --force-newton 2224
  sonic-bullet case new my_case hammer_test.uff --mesh bar.obj --material steel   (extra: uff)
  sonic-bullet case check my_case
  sonic-bullet fit my_case -o preset.json"""

CACHE_EPILOG = """\b
Examples:
  sonic-bullet cache
  sonic-bullet cache --limit 500MB
  sonic-bullet cache --clear
Another process may run meanwhile: it computes anew what it misses. SONIC_BULLET_CACHE_LIMIT bounds what is computed in
every run (2GB, where it is not set)."""

GROUP_EPILOG = """\b
Examples:
  sonic-bullet render scenes/tabletop.py -o tabletop.wav
  sonic-bullet modes mug.obj --material porcelain
  sonic-bullet doctor my_sim.py
'sonic-bullet COMMAND --help' shows each command's options and examples."""
