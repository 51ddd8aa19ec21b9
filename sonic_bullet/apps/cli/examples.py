"""Examples in each command's help."""

EXAMPLES = {
    "compare": """\b
Examples:
  sonic-bullet compare old/bar.py new/bar.py --report bar.html
  sonic-bullet compare scenes --ref main --json differences.json""",
    "baseline": """\b
Example:
  sonic-bullet baseline scenes/bar.py --reason "new cup"
""",
    "render": """\b
Examples:
  sonic-bullet render scenes/tabletop.py -o tabletop.wav --picture tabletop.png
  sonic-bullet render scenes/tabletop.py -o tabletop.wav --page tabletop.html   (seen, and each event alone)
  sonic-bullet render my_sim.py -o out.flac --material wood
  sonic-bullet render scenes/drop.py -o out.wav --contacts drop.npz --json
  sonic-bullet render scenes/drop.py -o out.wav --contacts small.npz --models reference
  sonic-bullet render scenes/drop.py -o out.wav --material mug=glass --silent board
  sonic-bullet render drop.npz -o again.wav      (the same bits, without PyBullet)
  sonic-bullet render drop.npz -o stereo.wav --microphone 0,-1,0.5 --microphone 0,1,0.5""",
    "modes": """\b
Examples:
  sonic-bullet modes mug.obj --material porcelain --scale 0.001
  sonic-bullet modes bar.stl --young 2.1e11 --poisson 0.3 --density 7850 --count 10
  sonic-bullet modes tray.obj --material metal --thickness 0.002 --to-hz 5000 --json tray.json -o tray.npz
  sonic-bullet modes fork.obj --material steel --fix 0,0,-0.1,0.01
  sonic-bullet modes plate.obj --material glass --uff plate.uff""",
    "bake": """\b
Examples:
  sonic-bullet bake bowl.obj --material steel -o bowl.html      (a page: struck in a browser, offline)
  sonic-bullet bake bowl.obj --material steel -o bowl.glb       (glTF with KHR_audio_rigid_bodies)
  sonic-bullet bake bowl.obj --material bowl.json --modes 30 --below 60 --points 100 -o bowl.json
  sonic-bullet bake mug.obj --material ceramic-mug -o mug.dsp   (faust2jack mug.dsp)
  sonic-bullet bake mug.obj --material porcelain -o mug.h
  sonic-bullet bake bar.obj --material brass --strike 0.1,0,0.005 --impulse 0.02 -o tap.wav
  sonic-bullet bake scenes/tabletop.py -o scene.glb             (bodies, physics, motion, sound)
  sonic-bullet bake scenes/tabletop.py -o scene.glb --emitters  (and clips, for viewers that play no modes)
  sonic-bullet bake table.npz --body mug -o mug.h""",
    "fit": """\b
Examples:
  sonic-bullet fit tap.wav --mesh bar.obj --strike 0.05,0,0.003 --material steel -o bar.json --picture bar.png
  sonic-bullet fit tap.wav --mesh mug.obj --scale 0.001 --strike 0,0.04,0 --sensor sum \
--material porcelain -o mug.json --json
  sonic-bullet fit my_case/ -o preset.json       (several strikes, sizes, sensors: a folder with a case.json)
  sonic-bullet fit my_case/ -o preset.json --dimension-tolerance 0.1 --uff modes.uff
  sonic-bullet fit cases/*/ -o out --workers 4 --csv lines.csv   (a folder a case, and out/summary.csv)
The preset plays at once: listener.add(body, material="preset.json").""",
    "residual": """\b
Examples:
  sonic-bullet residual my_case/ -o preset.json --picture preset.png
  sonic-bullet residual tap.wav --mesh bar.obj --strike 0.05,0,0.003 --material steel -o bar.json
  sonic-bullet residual tap.wav --material wood -o wood.json     \
(no shape known: the recording's features stand in for modes)
Hear a scene without: sonic-bullet render scene.py -o out.wav --no-residual""",
    "features": """\b
Examples:
  sonic-bullet features tap.wav
  sonic-bullet features tap.wav --json features.json --picture features.png
  sonic-bullet features tap.flac --band 200,8000 --onset 0""",
    "states": """\b
Examples:
  sonic-bullet states open/ muted/
  sonic-bullet states before.wav after.wav --picture moved.png
  sonic-bullet states bottle/ --number empty=0 --number half=1/2 --number full=1 --json series.json
  sonic-bullet states bars/ --pieces
More: docs/how-to/what-changed.md""",
    "diagnose": """\b
Examples:
  sonic-bullet diagnose my_case/
  sonic-bullet diagnose my_case/ --json verdict.json --predict predicted/ --report page.html
  sonic-bullet diagnose my_case/ --next           (which strike tells models apart that are still open)
  sonic-bullet diagnose my_case/ -o preset.json   (what belongs to material and object sounds in every scene)
  sonic-bullet diagnose cases/*/ -o out --workers 4 --report page.html
A verdict is none, explained, unexplained or worse-than-silence (exit 1).""",
    "case": """\b
Examples:
  sonic-bullet case new my_case --mesh bar.obj --recordings taps/*.wav --material steel --sensor pressure
  sonic-bullet case new my_taps long_recording.wav --split --hold-out 3
  sonic-bullet case new my_taps taps/*.wav --force-channel 1 --force-newton 2224
  sonic-bullet case new my_case hammer_test.uff --mesh bar.obj --material steel   (extra: uff)
  sonic-bullet case check my_case
  sonic-bullet fit my_case -o preset.json""",
    "cache": """\b
Examples:
  sonic-bullet cache
  sonic-bullet cache --limit 500MB
  sonic-bullet cache --clear
Another process may run meanwhile: it computes anew what it misses. SONIC_BULLET_CACHE_LIMIT bounds what is computed in
every run (2GB, where it is not set).""",
    "group": """\b
Examples:
  sonic-bullet render scenes/tabletop.py -o tabletop.wav
  sonic-bullet modes mug.obj --material porcelain
  sonic-bullet doctor my_sim.py
'sonic-bullet COMMAND --help' shows each command's options and examples.""",
    "dataset": """\b
Examples:
  sonic-bullet dataset impacts -o out --count 200               (a ready recipe; no code)
  sonic-bullet dataset household -o out --count 500 --objects 60 --format audiofolder
  sonic-bullet dataset my_recipe.py -o out --count 5000 --seed 7 --workers 8
The same command again makes what is missing. Exit 1: some samples could not be made; failures.jsonl has the reasons.\
""",
    "play": """\b
Examples:
  sonic-bullet play scenes/tabletop.py
  sonic-bullet play my_sim.py --material wood --full-scale 2
  sonic-bullet play drop.npz --device "USB Audio"
  sonic-bullet play drop.npz --head kemar.sofa --facing 0,0,0
  sonic-bullet play scenes/bar.py --device null      (no sound card: the same, unheard)
The physics runs as fast as the card takes its sound. The last line says what was played, how late each step sounds,
and how often there was nothing to play: then the scene is too much for this machine in real time; render it.""",
    "film": """\b
Examples:
  sonic-bullet film scenes/tabletop.py -o tabletop.mp4 --fps 60
  sonic-bullet film scenes/rolling.py -o why.mov --overlay --follow ball
  sonic-bullet film drop.npz -o drop.mkv --camera 0.5,-1,0.8 --look-at 0,0,0.1 --size 1920x1080
Frame rates are fractions: 24, 25, 30000/1001. Needs PyAV: pip install 'sonic_bullet[film]'""",
    "score": """\b
Examples:
  sonic-bullet score take1.glb -o take1.wav --materials table.json
  sonic-bullet score keys.npz -o keys.wav --contacts heard.npz
  sonic-bullet render heard.npz -o again.wav --stems stems --events what.csv
  sonic-bullet score shot.glb -o shot.wav --scale 0.01 --fps 24
  sonic-bullet score shot.glb -o shot.wav --ambisonics 1 --room 6x4x3
A contact log that it writes goes to render and film as any other. docs/how-to/score-an-animation.md has a table of
materials and an export script for Blender.""",
}
