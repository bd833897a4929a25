"""Examples: what `fitmat COMMAND --help` ends with.

They hold no flag.
"""

FIT = (
    "Columns of a table, by name: theta_i, theta_o and phi (or phi_i and phi_o, or a signed theta_o alone) in "
    "degrees; brdf, brdf_cos, reflectance_factor, radiance, or signal and reference; brdf_r, brdf_g, brdf_b or "
    "brdf_550 for channels; sigma where the noise is known.\n\n"
    "Written to --out: report.html (tables and pictures), fit.json (the same numbers), budget.txt (where the "
    "uncertainty of each comes from), posterior-MODEL.parquet (draws of the parameters). Ctrl-C during sampling keeps "
    "what is done and still writes them; a killed run goes on when it is given again.\n\n"
    "Examples:\n\n"
    "  fitmat fit measurements.csv\n\n"
    "  fitmat fit measurements.csv --models lambert+ggx --fix ks=1 --out run1\n\n"
    "  fitmat fit gold.csv --models ggx --ior Au --fix ks=1\n\n"
    "  fitmat fit scan.txt --columns theta_i=AOI,brdf=4 --no-mcmc\n\n"
    "  fitmat fit plate_10deg.txt plate_40deg.txt plate_70deg.txt --join\n\n"
    "  fitmat fit mirror.csv --receiver-angle 0.5 --calibration 0.03 --angle-error 0.1"
)

SIMULATE = (
    "Parameters that are not set keep the model's defaults, see fitmat models.\n\n"
    "Examples:\n\n"
    "  fitmat simulate lambert+ggx --set kd=0.3 --set alpha=0.2 --out plastic.csv\n\n"
    "  fitmat simulate ggx --ior Au --wavelengths 400:700:10 --set alpha=0.1 --out gold.csv\n\n"
    "  fitmat simulate ggx-film --film TiO2 --ior Ti --set thickness=50 --wavelengths 400:700:10 --out blue.csv\n\n"
    "  fitmat simulate lambert+ggx --dispersion cauchy --set cauchy_a=1.48 --wavelengths 400:700:10 --out clear.csv\n\n"
    "  fitmat simulate ggx-slab-schlick --set alpha=0.6 --set f0=0.9 --samples 4096 --out rough.csv"
)

CHECK = "Examples:\n\n  fitmat check measurements.csv --plot coverage.png\n\n  fitmat check gold.binary --json"

CONVERT = (
    "Examples:\n\n"
    "  fitmat convert gold.binary gold.parquet\n\n"
    "  fitmat convert scan.txt scan.bsdf --columns theta_i=AOI,brdf=4\n\n"
    "  fitmat convert plane.csv whole.binary --complete"
)

DESIGN = (
    "Examples:\n\n  fitmat design measurements.csv --for eta\n\n"
    "  fitmat design measurements.csv --for match --kind curve --plot next.png"
)

BATCH = (
    "Written to --out: index.html, a line for each file; results.parquet, one row for each file and model with every "
    "parameter, its interval, the doubts, the match and the seconds it took. A file that cannot be used is a "
    "row with its sentence. Interrupted or killed, the same command goes on; a file that changed is done again.\n\n"
    "One .npz file or Zarr group (.zarr) with an array value (rows, columns, samples, channels) or (points, samples, "
    "channels) is a texture: its directions are wi and wo, or theta_i, theta_o, phi_i, phi_o in degrees, the same at "
    "every point; sigma if it is known. texture.npz, or texture.zarr, has every parameter with its standard deviation, "
    "and the outcome, at every point; beside it are maps, and a glTF and a MaterialX material of them.\n\n"
    "Examples:\n\n  fitmat batch scans --out results\n\n"
    "  fitmat batch atlas.npz --models lambert+ggx --loss gaussian\n\n"
    "  fitmat batch 'scans/*.csv' --models lambert+ggx --fix ks=1\n\n"
    "  fitmat batch --jobs jobs.csv\n\n"
    "  fitmat batch --lights photos/lights.csv --smooth alpha,kd"
)

LABS = (
    "What the flags state of the instrument holds for each laboratory by itself: with --calibration 0.03 the scale of "
    "each may be off by 3 % of its own.\n\n"
    "Examples:\n\n  fitmat labs a.csv b.csv c.csv\n\n"
    "  fitmat labs a.csv b.csv --model lambert+beckmann --calibration 0.03 --angle-error 0.1 --json"
)

RENDER = (
    "A ball, seen from far away: no shadow, no light is reflected twice. The background is transparent.\n\n"
    "Examples:\n\n"
    "  fitmat render run1 --out ball.png\n\n"
    "  fitmat render ggx-conductor --set alpha=0.2 --set eta=0.18,0.42,1.37 --set kappa=3.42,2.35,1.77 --light 60,150"
)

EXPORT = (
    "Written to --out, with export.json, the values and how far the target's are from the model's:\n\n"
    "  glsl: NAME.glsl, the function vec3 brdf(vec3 wi, vec3 wo) to paste; NAME.vert and NAME.frag, lit with it\n\n"
    "  glsl-330: the same for desktop OpenGL\n\n"
    "  mitsuba: NAME.py, the dictionary; NAME.xml, a scene to include\n\n"
    "  materialx: NAME.mtlx, standard nodes or OpenPBR; openpbr: the closest OpenPBR surface\n\n"
    "  gltf: NAME.gltf, usd: NAME.usda, pbrt: NAME.pbrt, radiance: NAME.rad, the closest material that it can hold\n\n"
    "  blender: NAME.py, which makes the closest Principled BSDF; unreal, unity: NAME.json, values to type in\n\n"
    "  osl: NAME.osl, a shader of closures\n\n"
    "  zemax: NAME.bsdf; klems: NAME.xml, or one for each channel\n\n"
    "  table: NAME.csv, NAME.parquet, NAME.json\n\n"
    "  merl: NAME.binary\n\n"
    "Examples:\n\n"
    "  fitmat export run1 --to glsl\n\n"
    "  fitmat export run1 --to mitsuba --model lambert+ggx --name 'satin plastic' --out mine\n\n"
    "  fitmat export run1 --to table --theta-i 10,30,60 --step 2"
)

COMPARE = (
    "Examples:\n\n  fitmat compare run1 run2 run3\n\n  fitmat compare before-fitmat after-fitmat --out polished.html"
)

PLOT = (
    "Examples:\n\n  fitmat plot run1 --what curves --out fit.pdf\n\n"
    "  fitmat plot run1 --what residuals --channel g --width 178 --out residuals.svg"
)

COLOUR = (
    "Examples:\n\n"
    "  fitmat colour Au\n\n"
    "  fitmat colour brass --illuminant A --plot brass.pdf\n\n"
    "  fitmat colour --table metals"
)
